"""Pictures of the documentation that explain; a module a picture, each drawn for a narrow screen."""
