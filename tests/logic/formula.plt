:- use_module(library(plunit)).
:- use_module(library(occurs)).
:- use_module(cup_pool).
:- use_module('../../logic/generate').
:- use_module('../../logic/formula').

% made(+Rule, -Formula): what some item made by Rule says.

made(Rule, F) :-
    item(_, Id, _, _, Rule, _),
    item_formula(Id, _, _, F).

:- begin_tests(formula, [setup(open_cup)]).

test(a_view_hides_its_other_arguments, [true(F == some(v1, object, atpose(v1, v0))), nondet]) :-
    formula(view(atpose, [2]), [], F).

test(arguments_follow_the_view, [true(F == atpose(v1, v0)), nondet]) :-
    formula(view(atpose, [2,1]), [], F).

test(variables_are_numbered_in_order_of_appearance, [forall(member(Rule, [some, none, close, conj, guard]))]) :-
    forall(made(Rule, F),
           ( findall(V, ( sub_term(Part, F), quantifier(Part, V) ), Vs),
             ( Vs = [v0|_] -> First = 0 ; First = 1 ),
             forall(nth0(K, Vs, V), ( I is First + K, atom_concat(v, I, V) )) )).

quantifier(some(V, _, _), V).
quantifier(every(V, _, _), V).

test(every_item_has_one_formula) :-
    forall(item(_, Id, _, _, _, _),
           findall(F, item_formula(Id, _, _, F), [_])).

test(size, N == 5) :-
    formula_size(some(v1, o, conj(on(v0, v1), neg(red(v1)))), N).

:- end_tests(formula).
