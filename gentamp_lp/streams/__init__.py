"""The embedded PDDLStream engine: problems written for PDDLStream run by importing from here instead."""

from gentamp_lp.streams.constraints import WILD, OrderedSkeleton, PlanConstraints
from gentamp_lp.streams.downward import PLANNERS
from gentamp_lp.streams.language import (
    INF,
    TOTAL_COST,
    Action,
    And,
    Certificate,
    Equal,
    Exists,
    ExternalInfo,
    Fact,
    ForAll,
    Forall,
    FunctionInfo,
    Imply,
    Minimize,
    Not,
    Or,
    Output,
    PartialInputs,
    PDDLProblem,
    PredicateInfo,
    Solution,
    StreamInfo,
    Type,
    WildOutput,
    empty_gen,
    empty_test,
    fn_from_constant,
    from_constant,
    from_fn,
    from_gen,
    from_gen_fn,
    from_list_fn,
    from_list_gen_fn,
    from_sampler,
    from_test,
    negate_test,
    print_solution,
    universe_test,
)
from gentamp_lp.streams.solving import ALGORITHMS, Report, Result, solve

__all__ = [
    "ALGORITHMS", "INF", "PLANNERS", "TOTAL_COST", "WILD", "Action", "And", "Certificate", "Equal", "Exists",
    "ExternalInfo", "Fact", "ForAll", "Forall", "FunctionInfo", "Imply", "Minimize", "Not", "Or", "OrderedSkeleton",
    "Output", "PDDLProblem", "PartialInputs", "PlanConstraints", "PredicateInfo", "Report", "Result", "Solution",
    "StreamInfo", "Type", "WildOutput", "empty_gen", "empty_test", "fn_from_constant", "from_constant", "from_fn",
    "from_gen", "from_gen_fn", "from_list_fn", "from_list_gen_fn", "from_sampler", "from_test", "negate_test",
    "print_solution", "solve", "universe_test",
]  # fmt: skip
