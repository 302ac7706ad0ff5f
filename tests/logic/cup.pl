% Training data for tests and examples: one cup that moves between two tables. State 0: on the first, 1: held, 2: on the
% second. Of the poses, p1 is on the first table, p2 and p3 are on the second.

sort(object).
sort(pose).
predicate(on, [object,object]).
display(on, "On").
predicate(pose, [object,pose,object]).
predicate(atpose, [object,pose]).
predicate(cfree, [object,pose,object,pose]).
predicate(holding, [object]).
predicate(near, [object,object]).
owner(pose, pose, 2).
at_most_one(holding).

problem(0).
entity(0, object, cup).
entity(0, object, t1).
entity(0, object, t2).
entity(0, pose, p1).
entity(0, pose, p2).
entity(0, pose, p3).
static(0, pose(cup, p1, t1)).
static(0, pose(cup, p2, t2)).
static(0, pose(cup, p3, t2)).
static(0, cfree(cup, p1, cup, p2)).
static(0, cfree(cup, p1, cup, p3)).
static(0, cfree(cup, p2, cup, p1)).
static(0, cfree(cup, p3, cup, p1)).
static(0, near(cup, t1)).
static(0, near(cup, t2)).

state(0, 0).
state(1, 0).
state(2, 0).
fluent(0, on(cup, t1)).
fluent(0, atpose(cup, p1)).
fluent(1, holding(cup)).
fluent(2, on(cup, t2)).
fluent(2, atpose(cup, p2)).
transition(0, 0, 1).
transition(1, 1, 2).
transition(2, 2, 1).
