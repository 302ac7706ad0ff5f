:- use_module(library(plunit)).
:- use_module(cup_pool).
:- use_module('../../logic/rules').

:- begin_tests(rules).

problems(Text, Messages) :-
    text_file(Text, File),
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
    text_file("cap(role, 2).", F1),
    text_file("cap(role, 3).", F2),
    load_grammars([F1, F2], []),
    findall(What-N, cap(What, N), Caps).

:- end_tests(rules).
