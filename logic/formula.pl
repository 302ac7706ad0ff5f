:- module(formula,
          [ formula/3,              % +Rule, +Operands, -Formula
            item_formula/4,         % +Id, -Variable, -Sort, -Formula
            formula_size/2          % +Formula, -Size
          ]).
:- use_module(library(lists), [member/2, nth1/3, same_length/2]).
:- use_module(concepts, [concept/4]).
:- use_module(facts, [predicate/2]).
:- use_module(generate, [bucket/5, item/6, meta/6]).
:- use_module(rules, [grammar_rule/7, says/5, op(200, xfx, @)]).
:- use_module(terms, [bind_some/3, connective/2, fresh//1, rename//3]).

/** <module> The first-order formula of an item

    ?- read_facts('tests/logic/cup.pl'), formula(view(atpose, [2]), [], Formula).
    Formula = some(v1, object, atpose(v1, v0)).

Items refer to their operands by Id; says/5 of the grammar tells how a rule reads, and a view reads as its
predicate with the other arguments existentially quantified. Variables are v0 (the free one), v1, v2 ...
in order of appearance, all different.
*/

%!  item_formula(+Id, -Variable, -Sort, -Formula) is det.
%
%   Formula is what item Id says of Variable of Sort; both are `none` if it is closed.

item_formula(Id, Variable, Sort, Formula) :-
    once(item(Bucket, Id, _, _, _, _)),
    bucket(Bucket, Class, _, _, _),
    (   Class = con(Sort)
    ->  Variable = v0
    ;   Variable = none,
        Sort = none
    ),
    meta(Id, _, _, _, Rule, Operands),
    formula(Rule, Operands, Formula).

%!  formula(+Rule, +Operands:list, -Formula) is det.
%
%   Formula is the result of Rule for the items Operands, its free variables being v0, v1 ...

formula(Rule, Operands, Formula) :-
    result_class(Rule, Operands, Class),
    Class =.. [_|Sorts],
    variables(Sorts, Variables, 0, Next),
    read_rule(Rule, Operands, Variables, Formula, Next, _).

variables([], [], N, N).
variables([_|Sorts], [V|Vs], N0, N) :-
    fresh(V, N0, N1),
    variables(Sorts, Vs, N1, N).

result_class(view(Name, Positions), _, Class) :-
    !,
    same_length(Positions, Sorts),
    predicate(Name, _),
    Class =.. [view|Sorts].
result_class(concept(_, Positions), _, Class) :-
    !,
    same_length(Positions, Sorts),
    Class =.. [view|Sorts].
result_class(Rule, Operands, Class) :-
    operand_classes(Operands, Classes),
    grammar_rule(_, Rule, Classes, Class, _, _, _),
    !.

operand_classes([], []).
operand_classes([Id|Ids], [Class|Classes]) :-
    once(item(Bucket, Id, _, _, _, _)),
    bucket(Bucket, Class, _, _, _),
    operand_classes(Ids, Classes).

read_rule(view(Name, Positions), _, Variables, Formula, N0, N) :-
    !,
    predicate(Name, Sorts),
    arguments(Sorts, 1, Positions, Variables, Arguments, Bound, N0, N),
    Atom =.. [Name|Arguments],
    bind_some(Bound, Atom, Formula).
read_rule(concept(Name, Positions), _, Variables, Formula, N0, N) :-
    !,
    concept(Name, Arguments, _, Formula0),
    findall(Old-New, ( nth1(I, Variables, New), nth1(I, Positions, J), nth1(J, Arguments, Old) ), Substitution),
    rename(Formula0, Substitution, Formula, N0, N).
read_rule(Rule, Operands, Variables, Formula, N0, N) :-
    operand_classes(Operands, Classes),
    says(Rule, Classes, Operands, Variables, Template),
    !,
    expand(Template, Formula, N0, N).

% The last quantifier introduced is the innermost.
arguments([], _, _, _, [], [], N, N).
arguments([T|Ts], I, Positions, Variables, [V|Vs], Bound, N0, N) :-
    I1 is I + 1,
    (   nth1(J, Positions, I)
    ->  nth1(J, Variables, V),
        arguments(Ts, I1, Positions, Variables, Vs, Bound, N0, N)
    ;   fresh(V, N0, N1),
        Bound = [V-T|Bound1],
        arguments(Ts, I1, Positions, Variables, Vs, Bound1, N1, N)
    ).

expand(Id@Variables, Formula, N0, N) :-
    !,
    meta(Id, _, _, _, Rule, Operands),
    read_rule(Rule, Operands, Variables, Formula, N0, N).
expand(some(V, T, A), some(V, T, F), N0, N) :-
    !,
    fresh(V, N0, N1),
    expand(A, F, N1, N).
expand(every(V, T, A), every(V, T, F), N0, N) :-
    !,
    fresh(V, N0, N1),
    expand(A, F, N1, N).
expand(closure(U, W, T, A, Y, X), closure(U, W, T, F, Y, X), N0, N) :-
    !,
    fresh(U, N0, N1),
    fresh(W, N1, N2),
    expand(A, F, N2, N).
expand(neg(A), neg(F), N0, N) :-
    expand(A, F, N0, N).
expand(conj(A, B), conj(F, G), N0, N) :-
    expand(A, F, N0, N1),
    expand(B, G, N1, N).
expand(disj(A, B), disj(F, G), N0, N) :-
    expand(A, F, N0, N1),
    expand(B, G, N1, N).
expand(implies(A, B), implies(F, G), N0, N) :-
    expand(A, F, N0, N1),
    expand(B, G, N1, N).
expand(true, true, N, N).

%!  formula_size(+Formula, -Size) is det.
%
%   How many atoms, connectives and quantifiers Formula has.

formula_size(Formula, Size) :-
    findall(x, part(Formula), Parts),
    length(Parts, Size).

part(_).
part(F) :-
    connective(F, Parts),
    member(Part, Parts),
    part(Part).
