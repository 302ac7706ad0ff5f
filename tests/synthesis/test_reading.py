"""Bad input is named with file and line; good input means what the format says."""

import pytest

from gentamp_lp.base.terms import read_facts
from gentamp_lp.errors import InputError
from gentamp_lp.synthesis import read_problem, synthesize
from gentamp_lp.synthesis.reading import parse_problem

GRAPH = "state(a). state(b). initialState(a). goal(b). action(go).\ntransition(a,go,b).\n"
QNP = "numeric(n). boolean(b). init(n, positive).\ngoal(n, zero). action(down). eff(down, n, decrease).\n"


def test_terms_comments_and_strings():
    text = '%* two\nlines *% f(a, "x, (y)", g( 1 , (2,3) )). % f(z)\n\nn.'
    facts = read_facts(text, "t.lp")
    assert [(fact.name, fact.args, fact.line) for fact in facts] == [
        ("f", ("a", '"x, (y)"', "g(1,(2,3))"), 2),
        ("n", (), 4),
    ]


@pytest.mark.parametrize(
    ("text", "line", "message"),
    [
        ("state(a) :- b.", 1, "not a fact: `:`"),
        ("\nstate(X).", 2, "not a fact: `X`"),
        ("state(a)\n", 1, "expected `.`, found `the end`"),
        ("state(a,).", 1, "expected a term, found `)`"),
        ("state(a b).", 1, "expected `)`, found `b`"),
        ("state(", 1, "expected a term, found `the end`"),
        (GRAPH + "node(a).", 3, "unknown predicate node/1"),
        (GRAPH + "goal(a,b).", 3, "goal takes 1 argument(s), not 2"),
        (GRAPH + "transition(a,b).", 3, "transition takes 3 argument(s), not 2"),
        (GRAPH + "transition(a,go,c).", 3, "transition(a,go,c): no such state `c`"),
        (GRAPH + "transition(a,fly,b).", 3, "transition(a,fly,b): no such action `fly`"),
        (GRAPH + "con_A(fly,1).", 3, "con_A(fly,1): no such action `fly`"),
        (GRAPH + "\ngoal(c).", 4, "goal(c): no such state `c`"),
        ("state(a). goal(a).", None, "there is no initialState fact"),
        (QNP + "\npre(down, m, zero).", 4, "pre(down,m,zero): no such variable `m`"),
        (QNP + "pre(up, n, zero).", 3, "pre(up,n,zero): no such action `up`"),
        (QNP + "pre(down, n, false).", 3, "pre(down,n,false): `false` does not fit"),
        (QNP + "eff(down, b, increase).", 3, "eff(down,b,increase): `increase` does not fit"),
        (QNP + "\ninit(n, zero).", 4, "init(n,zero) contradicts init(n,positive) in line 1"),
        (QNP + "pre(down, n, zero).", 2, "eff(down,n,decrease) contradicts pre(down,n,zero) in line 3"),
        (QNP + "eff(down, n, increase).", 3, "eff(down,n,increase) contradicts eff(down,n,decrease) in line 2"),
        (QNP + "boolean(n).", 3, "n is both numeric and boolean"),
        (QNP + "state(a).", 3, "unknown predicate state/1"),
        ("numeric(n). action(a).", None, "there is no goal fact"),
        ("goal(n0,zero). action(a)." + "".join(f"numeric(n{i})." for i in range(25)), None, "at most 24"),
    ],
)
def test_bad_input(text, line, message):
    with pytest.raises(InputError) as caught:
        parse_problem([("problem.lp", text)])
    diagnostic = caught.value.diagnostics[0]
    assert message in diagnostic.message
    assert (diagnostic.path, diagnostic.line) == ("problem.lp", line)


def test_a_missing_file(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_problem([tmp_path / "none.lp"])


def test_a_variable_without_init_starts_either_way():
    problem = parse_problem([("p.lp", "numeric(n). boolean(b). goal(n, zero). action(a). eff(a, n, decrease).")])
    assert problem.states == ("n>0, b", "n=0, b", "n>0, -b", "n=0, -b")
    assert len(problem.initial) == 4 and len(problem.goals) == 2 and len(problem.choices) == 2
    assert synthesize(problem).fairness == "qnp"


def test_what_cannot_be_reached_is_left_out():
    problem = parse_problem([("g.lp", GRAPH + "state(c). transition(c,go,a). transition(b,go,c).")])
    assert problem.states == ("a", "b") and len(problem.choices) == 1


def test_fairness_of_actions():
    """In a con_A with an empty con_B: fair; in none: adversarial; blocked while con_B is taken in the loop."""
    loop = GRAPH + "transition(a,go,a)."
    assert synthesize(parse_problem([("g.lp", loop)]), fairness="qnp").solvable is False
    assert synthesize(parse_problem([("g.lp", loop + "con_A(go,1).")]), fairness="qnp").solvable
    both = loop + "con_A(go,1). con_B(go,1)."
    assert synthesize(parse_problem([("g.lp", both)]), fairness="qnp").solvable is False
    assert synthesize(parse_problem([("g.lp", both + "con_A(go,2).")]), fairness="qnp").solvable
    assert synthesize(parse_problem([("g.lp", loop)])).fairness == "strong-cyclic"
