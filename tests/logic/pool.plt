:- use_module(library(plunit)).
:- use_module('../../logic/pool').
:- use_module('../../logic/facts').
:- use_module('../../logic/rules').
:- use_module('../../logic/views').
:- use_module('../../logic/features').
:- use_module('../../logic/formula').

% One cup that moves between two tables: state 0 (on the first), 1 (held), 2 (on the second).

data("sort(object). sort(pose).
      predicate(on, [object,object]). predicate(pose, [object,pose,object]). predicate(atpose, [object,pose]).
      predicate(cfree, [object,pose,object,pose]). predicate(holding, [object]). predicate(near, [object,object]).
      owner(pose, pose, 2). at_most_one(holding).
      problem(0). entity(0, object, cup). entity(0, object, t1). entity(0, object, t2).
      entity(0, pose, p1). entity(0, pose, p2).
      static(0, pose(cup, p1, t1)). static(0, pose(cup, p2, t2)). entity(0, pose, p3). static(0, pose(cup, p3, t2)).
      static(0, cfree(cup, p1, cup, p2)). static(0, cfree(cup, p1, cup, p3)).
      static(0, cfree(cup, p2, cup, p1)). static(0, cfree(cup, p3, cup, p1)).
      static(0, near(cup, t1)). static(0, near(cup, t2)).
      state(0, 0). state(1, 0). state(2, 0).
      fluent(0, on(cup, t1)). fluent(0, atpose(cup, p1)).
      fluent(1, holding(cup)).
      fluent(2, on(cup, t2)). fluent(2, atpose(cup, p2)).
      transition(0, 0, 1). transition(1, 1, 2). transition(2, 2, 1).").

open_data :-
    data(Text),
    tmp_file_stream(File, Out, [encoding(utf8)]),
    write(Out, Text),
    close(Out),
    source_file(pool:pool_open(_), Pool),
    file_directory_name(Pool, Folder),
    atom_concat(Folder, '/grammar.lp', Grammar),
    with_output_to(string(_), pool_grammar([Grammar])),
    pool_open(File),
    forall(between(0, 3, Cost), pool_level(Cost)).

views(Name, Views) :-
    findall(Kind-Positions, view(Kind, _, Name, Positions, _, _), Views).

:- begin_tests(views, [setup(open_data)]).

test(a_pose_determines_its_object, Views == [own-[2,1], pred-[2]]) :-
    views(atpose, Views0),
    sort(Views0, Views).

test(a_collision_test_relates_two_poses, Views == [test-[2,4], test-[4,2]]) :-
    views(cfree, Views0),
    maplist([_-P, test-P]>>true, Views0, Views).

test(a_stream_ties_its_output_to_every_input, Ties == [[1,2], [2,1], [2,3], [3,2]]) :-
    views(pose, Views),
    findall(P, ( member(_-P, Views), length(P, 2) ), Ties0),
    sort(Ties0, Ties).

test(a_product_is_replaced_by_its_projections, Views == [pred-[1], pred-[2]]) :-
    views(near, Views).

test(unary, Views == [pred-[1]]) :-
    views(holding, Views).

:- end_tests(views).

:- begin_tests(features, [setup(open_data)]).

test(holding_is_boolean, [true(F == feature(boolean, 0b010)), nondet]) :-
    representative(_, 1, Kind, Item, Pos, _, _),
    item_formula(Item, v0, object, holding(v0)),
    F = feature(Kind, Pos).

test(changes, [true(Changes == [0,2]-[1]), nondet]) :-
    representative(_, _, numeric, _, 0b101, Inc, Dec),
    transitions(Dec, Down),
    transitions(Inc, Up),
    Changes = Down-Up.

test(projection_is_printed_with_its_quantifier, [true, nondet]) :-
    representative(_, _, _, Item, _, _, _),
    item_formula(Item, v0, pose, some(v1, object, atpose(v1, v0))).

test(numbered_from_one, Ids == Expected) :-
    findall(Id, representative(Id, _, _, _, _, _, _), Ids),
    length(Ids, N),
    numlist(1, N, Expected).

transitions(Bits, Ts) :-
    findall(T, ( transition_bit(B, T), Bits /\ (1<<B) =\= 0 ), Ts0),
    sort(Ts0, Ts).

:- end_tests(features).

:- begin_tests(rules).

problems(Text, Messages) :-
    tmp_file_stream(File, Out, [encoding(utf8)]),
    write(Out, Text),
    close(Out),
    load_grammars([File], Diagnostics),
    findall(Line-Message, member(diagnostic(_, Line, _, Message), Diagnostics), Messages).

test(good, Messages == []) :-
    problems("rule(a, [con(X)], prop, 1).\nsem(a, [C], _, [A], D) :- some(C, A, D).\n\c
              says(a, [con(T)], [C], [], some(V, T, C@[V])).\n", Messages0),
    exclude([_-M]>>sub_string(M, _, _, _, "once"), Messages0, Messages).

test(no_way_out, [forall(member(Body, ["halt", "meet(A,A,E), shell(ls)", "engine:meet(A,A,D)", "\\+ meet(A,A,D)",
                                       "(meet(A,A,D) ; true)", "call(A)", "D is 1"])),
                  true(Line-Known == 2-true)]) :-
    format(string(Text), "\nsem(a, _, _, [A], D) :- meet(A, A, D), ~s.\n", [Body]),
    problems(Text, [Line-Message|_]),
    ( sub_string(Message, _, _, _, "primitive") -> Known = true ; Known = false ).

test(caps_of_a_later_file_replace_earlier_ones, Caps == [role-3]) :-
    tmp_file_stream(F1, O1, []), write(O1, "cap(role, 2)."), close(O1),
    tmp_file_stream(F2, O2, []), write(O2, "cap(role, 3)."), close(O2),
    load_grammars([F1, F2], []),
    findall(What-N, cap(What, N), Caps).

:- end_tests(rules).
