"""The policy value: its check, its text, its drawing, and the bundle on disk."""

import xml.etree.ElementTree as ElementTree
from dataclasses import replace

import pytest
from helpers.worlds import LOAD_SIZES, UNSTACK_SIZES, Load, Unstack, gather

from gentamp_lp.abstraction.choose import synthesize_policy
from gentamp_lp.errors import InputError
from gentamp_lp.policy.certify import certify
from gentamp_lp.policy.model import CertificateStep, Rule
from gentamp_lp.policy.policy import Policy
from gentamp_lp.solvers.asp import GroundProgram


def learn(worlds):
    data = gather(worlds)
    formulas = {f: f"some(v1,object,conj(on(v0,v1),'is-{f}'(v1)))" for f in data.texts}
    return Policy.from_solution(
        synthesize_policy(data.facts),
        data.facts,
        formulas,
        {f: f'{text} \\ "really"' for f, text in data.texts.items()},
        task="load",
        variables={f: ("v0", "object") for f in data.texts if f > 1},
        extra={"sampled": 12, "note": "a\nb", "sizes": [[1, 3], [4, 2]]},
    )


@pytest.fixture(scope="module")
def policy():
    return learn([Load(*size) for size in LOAD_SIZES])


@pytest.fixture(scope="module")
def unstack():
    return learn([Unstack(*size) for size in UNSTACK_SIZES])


@pytest.fixture
def bundle(policy, tmp_path):
    save(policy, tmp_path / "load")
    return tmp_path / "load"


def save(policy, folder):
    policy.save(folder, domain_pddl="(define (domain d))\n", stream_pddl="(define (stream d))\n", report={"a": 1})


def content(folder):
    return {path.name: path.read_bytes() for path in sorted(folder.iterdir())}


def test_rule_for_takes_names_or_positions(policy):
    start = policy.initial[0]
    rule = policy.rule_for(start)
    assert rule == policy.rule_for(dict(zip(("f1", "f2", "f3", "f4"), start, strict=True)))
    assert policy.action(rule.action).schemas == ("pick",)
    assert policy.rule_for(policy.goals[0]) is None


def test_check_accepts_what_was_learned(policy, unstack):
    assert policy.check() == []
    assert unstack.check() == []


def without_rule(policy):
    return replace(policy, rules=policy.rules[:-1])


def illegal_outcome(policy):
    first = policy.rules[0]
    return replace(policy, rules=(replace(first, outcomes=(policy.goals[0],)), *policy.rules[1:]))


def rule_in_goal(policy):
    return replace(policy, rules=(*policy.rules, Rule(policy.goals[0], "a1", policy.goals)))


def no_certificate(policy):
    return replace(policy, certificate=())


def claims_strong(policy):
    return replace(policy, fairness="strong")


def half_a_component(policy):
    step = policy.certificate[0]
    return replace(policy, certificate=(CertificateStep(step.feature, step.states[:1]), *policy.certificate[1:]))


def against_precondition(policy):
    return replace(policy, rules=(replace(policy.rules[0], action="a2"), *policy.rules[1:]))


def no_goal(policy):
    return replace(policy, goals=policy.goals[:0])


def twice(policy):
    return replace(policy, rules=(*policy.rules, policy.rules[0]))


def unknown_start(policy):
    return replace(policy, initial=(*policy.initial, (True,) * len(policy.features)))


@pytest.mark.parametrize(
    "break_it, complaint",
    [
        (without_rule, "not closed"),
        (illegal_outcome, "cannot lead to"),
        (rule_in_goal, "rule in a goal state"),
        (no_certificate, "a loop is left"),
        (claims_strong, "a loop is left"),
        (half_a_component, "not a whole component"),
        (against_precondition, "against its precondition"),
        (no_goal, "no goal can be reached"),
        (twice, "two rules"),
        (unknown_start, "no rule for the initial state"),
    ],
)
def test_check_finds(policy, break_it, complaint):
    assert any(complaint in problem for problem in break_it(policy).check())


def test_a_rising_count_is_no_certificate(unstack):
    """Putting a block back on a tower raises what picking lowers."""
    pick, put = unstack.actions
    put = replace(put, preconditions={"f1": True, "f2": False})
    back = replace(put, name="a3", preconditions={"f1": True, "f2": True}, effects={"f1": "false", "f2": "increase"})
    rules = tuple(replace(r, action="a3") if r.valuation == (True, True) else r for r in unstack.rules)
    wrong = replace(unstack, actions=(pick, put, back), rules=rules)
    assert any("rises in its component" in problem for problem in wrong.check())
    assert certify(wrong.rules, wrong.actions, ["f1", "f2"])[0] == "strong-cyclic"
    assert replace(wrong, fairness="strong-cyclic", certificate=()).check() == []


def test_strong_needs_no_certificate(unstack):
    last = tuple(replace(rule, outcomes=rule.outcomes[-1:]) for rule in unstack.rules if not rule.valuation[1])
    assert certify(last, unstack.actions, ["f1", "f2"]) == ("strong", ())


def test_text_shows_features_actions_and_rules(unstack):
    text = unstack.text()
    assert "pre: f1=⊥, f2>0" in text
    assert "eff: f1=⊤, f2↓" in text
    assert "f1=⊥, f2>0  do a1  (initial)" in text
    assert "to f1=⊥, f2=0  (goal)" in text


def test_round_trip_to_the_byte(policy, bundle, tmp_path):
    loaded = Policy.load(bundle)
    assert loaded == policy
    save(loaded, tmp_path / "again")
    assert content(tmp_path / "again") == content(bundle)
    assert sorted(content(bundle)) == [
        "domain.pddl", "features.pl", "policy.lp", "policy.svg", "report.json", "stream.pddl",
    ]  # fmt: skip


def test_policy_lp_is_a_program(bundle):
    text = (bundle / "policy.lp").read_text()
    rules = "answered(S) :- rule(S, _). answered(S) :- goal(S). :- outcome(_, S), not answered(S)."
    outcome = GroundProgram([bundle / "policy.lp"], rules + " #show.").solve()
    assert outcome.answers and text.startswith("% A generalized policy")


def test_an_older_bundle_is_replaced_and_nothing_is_left_beside(policy, bundle):
    save(replace(policy, task="other"), bundle)
    assert Policy.load(bundle).task == "other"
    assert [path.name for path in bundle.parent.iterdir()] == ["load"]


def test_a_failed_save_leaves_the_old_bundle(policy, bundle):
    before = content(bundle)
    with pytest.raises(TypeError):
        policy.save(bundle, domain_pddl="", stream_pddl="", report={"not JSON": object()})
    assert content(bundle) == before
    assert [path.name for path in bundle.parent.iterdir()] == ["load"]


def test_a_folder_with_something_else_is_not_replaced(policy, tmp_path):
    (tmp_path / "thesis.tex").write_text("years of work")
    with pytest.raises(InputError, match="not a policy bundle"):
        save(policy, tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("effect(a1, f1, true).", "effect(a1, f1, decrease).", r"policy.lp:\d+: error: unknown name decrease"),
        ("rule(s1, a1).", "rule(s1, a9).", r"policy.lp:\d+: error: unknown name a9"),
        ("rule(s1, a1).", "rule(s1, a1)", r"policy.lp:\d+: error: expected `.`, found `outcome`"),
        ("rule(s1, a1).", "rule(s1).", r"policy.lp:\d+: error: rule has 2 arguments"),
        ("rule(s1, a1).", "rule(s1, ).", r"policy.lp:\d+: error: expected a term, found `\)`"),
        ("rule(s1, a1).", "", r"outcome of s1, which has no rule"),
        ("value(s1, f1, false).", "", r"policy.lp:\d+: error: state s1 has no value of f1"),
        ("cost(12).", "cost(many).", r"policy.lp:\d+: error: not a number: many"),
        ('fairness("qnp").', "", r"want one fairness/1 fact, found 0"),
        ("action(a1).", "action(a1).  % edited\n  schema(a1", r"policy.lp:\d+: error: "),
    ],
)
def test_a_mistake_in_policy_lp_has_a_line(bundle, old, new, message):
    path = bundle / "policy.lp"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        Policy.load(bundle)


@pytest.mark.parametrize(
    "old, new, message",
    [
        ("feature(f1, boolean", "feature(f7, boolean", "feature f1 has no clause"),
        ("feature(f1, boolean", "feature(f1, numeric", r"features.pl:\d+: error: kind or cost"),
        ("feature(f1, boolean", "feature(f9, boolean, 1, none, none, x).\nfeature(f1, boolean", "f9 is not in policy"),
        ("(v1)))).", "(v1))))", r"features.pl:\d+: error: "),
    ],
)
def test_a_mistake_in_features_pl_has_a_line(bundle, old, new, message):
    path = bundle / "features.pl"
    text = path.read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=message):
        Policy.load(bundle)


def test_an_edited_formula_is_read(bundle):
    path = bundle / "features.pl"
    path.write_text(path.read_text().replace("some(v1,object,", "every(v1, object, ", 1))
    assert Policy.load(bundle).features[0].formula.startswith("every(v1,object,conj(")


def test_a_missing_bundle(tmp_path):
    with pytest.raises(InputError, match=r"policy.lp"):
        Policy.load(tmp_path)


def rectangles(root, kinds):
    boxes = []
    for rect in root.iter("{http://www.w3.org/2000/svg}rect"):
        if rect.get("class") in kinds:
            x, y, w, h = (float(rect.get(name)) for name in ("x", "y", "width", "height"))
            boxes.append((x, y, x + w, y + h))
    return boxes


def test_the_drawing_has_a_box_for_each_state_and_label_and_none_overlap(policy, unstack):
    for drawn in (policy, unstack):
        root = ElementTree.fromstring(drawn.svg())
        states = rectangles(root, {"n", "g", "i"})
        labels = rectangles(root, {"l"})
        assert len(states) == len({r.valuation for r in drawn.rules} | set(drawn.goals))
        assert len(labels) == sum(after != r.valuation for r in drawn.rules for after in r.outcomes)
        boxes = states + labels
        for i, (a, b, c, d) in enumerate(boxes):
            assert a >= 0 or b >= 0
            for e, f, g, h in boxes[:i]:
                assert c <= e or g <= a or d <= f or h <= b
        assert len(rectangles(root, {"o"})) == len(drawn.goals)


def test_a_loop_on_one_state_is_drawn():
    """One count that falls: the smallest policy with a loop of one step."""
    facts = "state(1,1). state(2,1). state(3,1). initial(1). goal(3). feature(1,1,numeric). " + (
        "pos(1,1). pos(1,2). transition(1,1,2). transition(2,2,3). candidate(1). candidate(2). dec(1,1). dec(1,2)."
        " action(1,eat). action(2,eat)."
    )
    policy = Policy.from_solution(synthesize_policy(facts), facts, {1: "food(v0)"}, {1: "food"})
    assert policy.check() == []
    assert policy.rules[0].outcomes == ((True,), (False,))
    assert policy.svg().count("eat") == 2


def test_an_initial_state_after_another_one_is_drawn():
    """Two ways to begin, one of which leads to the other."""
    facts = (
        "state(1,1). state(2,1). state(3,2). state(4,2). initial(1). initial(3). goal(4). pos(1,1)."
        " feature(1,1,numeric). feature(2,1,boolean). pos(2,4). transition(1,1,2). transition(2,3,4)."
        " candidate(1). candidate(2). dec(1,1). inc(2,2). action(1,eat). action(2,rest)."
    )
    policy = Policy.from_solution(synthesize_policy(facts), facts, {1: "food(v0)", 2: "tired"}, {1: "food", 2: "tired"})
    assert len(policy.rules) == len(policy.initial) == 2
    assert policy.rules[1].valuation in policy.rules[0].outcomes
    assert policy.svg().count("rest") == 1
