:- use_module(library(plunit)).
:- use_module(cup_pool).
:- use_module('../../logic/engine').
:- use_module('../../logic/generate').

% kept(?Id, ?Class, ?Cost, ?Bits): a formula that was kept.

kept(Id, Class, Cost, Bits) :-
    item(Bucket, Id, _, _, _, Bits),
    bucket(Bucket, Class, Literals, Variables, _),
    Cost is max(Literals, Variables).

:- begin_tests(generate, [setup(open_cup)]).

test(levels_have_their_cost, Costs == [1,2,3]) :-
    findall(C, ( kept(_, Class, C, _), memberchk(Class, [prop, con(_)]) ), Costs0),
    sort(Costs0, Costs).

test(denotations_are_unique_in_a_class) :-
    findall(Class-Bits, kept(_, Class, _, Bits), All),
    length(All, N),
    sort(All, Distinct),
    length(Distinct, N),
    N > 50.

test(none_is_always_true_or_false) :-
    forall(( kept(_, Class, _, Bits), memberchk(Class, [prop, con(_), role(_,_)]) ),
           ( Bits =\= 0, mask(Class, Mask), Bits =\= Mask )).

test(all_candidates_are_accounted_for) :-
    aggregate_all(sum(N), rule_count(_, _, new, N), New),
    formula_count(New),
    aggregate_all(count, item(_, _, _, _, _, _), New).

test(costs_add_up) :-
    forall(( meta(Id, _, _, _, conj, [A,B]), kept(Id, _, _, _) ),
           ( once(( item(I, Id, _, _, _, _), item(J, A, _, _, _, _), item(K, B, _, _, _, _) )),
             maplist([X,L]>>bucket(X, _, L, _, _), [I,J,K], [LI,LJ,LK]),
             LI =:= LJ + LK )).

:- end_tests(generate).
