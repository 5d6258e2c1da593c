"""Quadratic programs of an OCP, by their stages.

`drive.mpc.ocp` makes one record of stages (`stages.Stages`) from the reference, the limits and the weights; the model
linearised gives F_k. Our interior-point method takes the record as it is: two-sided bounds become inequalities from
below, and no more. The MathematicalProgram that Drake's solvers solve, and OSQP's matrices, are made from the same.

Why the solver is ours: on 3,858 recorded QPs of drifting, in one run (one core of a Xeon), median and worst [ms] are

    N    ours, from the last solution    PIQP 0.7, sparse_multistage, data updated, variables in stage order
    10   0.16  0.49                      0.33  0.66
    25   0.27  1.6                       0.71  2.1
    45   0.40  4.6                       1.27  8.0

OSQP (`--control.qp osqp`) is cut off at 30 iterations: it does not solve every QP of a drift in them.
"""
