# Completion of drift-drake's commands and options in bash, and in zsh after `autoload -U bashcompinit && bashcompinit`.
_drift_drake() {
    local words
    if [ "$COMP_CWORD" = 1 ]; then
        words=$(drift-drake --help | awk '/^  [a-z]/ { print $1 }')
    else
        words=$(drift-drake "${COMP_WORDS[1]}" --help | grep -o -e '--[a-z][a-z-]*' | sort -u)
    fi
    COMPREPLY=($(compgen -W "$words" -- "${COMP_WORDS[COMP_CWORD]}"))
}
complete -o default -F _drift_drake drift-drake
