:- module(terms,
          [ connective/2,           % +Formula, -Parts
            pair/3,                 % +Formula, -Left, -Right
            fresh//1,               % -Variable
            bind_some/3,            % +Variables, +Formula, -Bound
            rename//3,              % +Formula, +Substitution, -Renamed
            formula_cost/3          % +Formula, +Hidden, -Cost
          ]).
:- use_module(library(apply), [maplist/3]).
:- use_module(library(lists), [member/2, nth1/3]).
:- autoload(library(yall), [(>>)/4]).

/** <module> Formulas as terms

    ?- rename(some(v1, object, on(v0, v1)), [v0-v5], Renamed, 7, Next).
    Renamed = some(v7, object, on(v5, v7)), Next = 8.

A formula is an atom like on(v0,v1), a connective neg/1, conj/2, disj/2, implies/2 or true, a quantifier
some(Variable, Sort, F) or every(Variable, Sort, F), or closure(U, W, Sort, F, Y, X): (Y,X) is in the transitive
closure of {(U,W) | F}. Variables are v0, v1 ...; the state of the grammars here is the number of the next one.
*/

%!  connective(+Formula, -Parts:list) is semidet.
%
%   Formula is a connective or quantifier over Parts, and no atom.

connective(true, []).
connective(neg(F), [F]).
connective(conj(F, G), [F,G]).
connective(disj(F, G), [F,G]).
connective(implies(F, G), [F,G]).
connective(some(_, _, F), [F]).
connective(every(_, _, F), [F]).
connective(closure(_, _, _, F, _, _), [F]).

%!  pair(+Formula, -Left, -Right) is semidet.
%
%   Formula is a connective of two parts.

pair(conj(F, G), F, G).
pair(disj(F, G), F, G).
pair(implies(F, G), F, G).

%!  fresh(-Variable)// is det.
%
%   Variable is the next one.

fresh(V, N0, N) :-
    atom_concat(v, N0, V),
    N is N0 + 1.

%!  bind_some(+Variables:list, +Formula, -Bound) is det.
%
%   Bound says that Formula holds for some Variables (pairs Variable-Sort), the first one outermost.

bind_some([], F, F).
bind_some([V-Sort|Variables], F0, some(V, Sort, F)) :-
    bind_some(Variables, F0, F).

%!  rename(+Formula, +Substitution:list, -Renamed)// is det.
%
%   Replace free variables by Substitution (pairs Old-New) and bound ones by fresh ones.

rename(true, _, true) --> !.
rename(neg(A), S, neg(F)) -->
    !,
    rename(A, S, F).
rename(Pair, S, Result) -->
    { pair(Pair, A, B) },
    !,
    rename(A, S, F),
    rename(B, S, G),
    { functor(Pair, Connective, 2),
      Result =.. [Connective,F,G] }.
rename(some(V0, Sort, A), S, some(V, Sort, F)) -->
    !,
    fresh(V),
    rename(A, [V0-V|S], F).
rename(every(V0, Sort, A), S, every(V, Sort, F)) -->
    !,
    fresh(V),
    rename(A, [V0-V|S], F).
rename(closure(U0, W0, Sort, A, Y0, X0), S, closure(U, W, Sort, F, Y, X)) -->
    !,
    fresh(U),
    fresh(W),
    rename(A, [U0-U, W0-W|S], F),
    { memberchk(Y0-Y, S),
      memberchk(X0-X, S) }.
rename(Atom0, S, Atom) -->
    { Atom0 =.. [Name|Vs0],
      maplist([V0, V]>>memberchk(V0-V, S), Vs0, Vs),
      Atom =.. [Name|Vs] }.

% ---- Cost

:- meta_predicate formula_cost(+, 2, -).

%!  formula_cost(+Formula, :Hidden, -Cost) is det.
%
%   The larger of the number of literals (and one for closing a formula or a relation, or for an implication that is
%   not the body of a universal quantifier) and of the number of variables, as in the grammar. Hidden is called with an
%   atom and the positions of its variables that occur nowhere else; they are not counted if it succeeds. Formula is
%   formula(Variable, Body), where Variable is `none` if Body is closed.

formula_cost(formula(Free, Formula), Hidden, Cost) :-
    measure(Formula, Hidden, Literals, Variables),
    (   Free == none
    ->  ( quantified(Formula) -> Closing = 1 ; Closing = 0 ),
        Cost is max(Literals + Closing, Variables)
    ;   Cost is max(Literals, Variables + 1)
    ).

quantified(some(_, _, _)).
quantified(every(_, _, _)).
quantified(neg(F)) :- quantified(F).
quantified(Pair) :- pair(Pair, F, G), ( quantified(F) ; quantified(G) ).

measure(true, _, 0, 0) :- !.
measure(neg(F), Hidden, L, V) :- !, measure(F, Hidden, L, V).
measure(Pair, Hidden, L, V) :-
    pair(Pair, F, G),
    !,
    measure(F, Hidden, L1, V1),
    measure(G, Hidden, L2, V2),
    ( Pair = implies(_, _) -> Extra = 1 ; Extra = 0 ),
    L is L1 + L2 + Extra,
    V is V1 + V2.
measure(every(_, _, implies(F, G)), Hidden, L, V) :-
    !,
    measure(conj(F, G), Hidden, L, V1),
    V is V1 + 1.
measure(Projection, Hidden, 1, 0) :-
    projected(Projection, Vs, Atom),
    Vs = [_|_],
    hidden_positions(Vs, Atom, Positions),
    call(Hidden, Atom, Positions),
    !.
measure(some(_, _, F), Hidden, L, V) :- !, measure(F, Hidden, L, V1), V is V1 + 1.
measure(every(_, _, F), Hidden, L, V) :- !, measure(F, Hidden, L, V1), V is V1 + 1.
measure(closure(_, _, _, F, _, _), Hidden, L, V) :- !, measure(F, Hidden, L1, V), L is L1 + 1.
measure(_, _, 1, 0).

projected(some(V, _, F), [V|Vs], Atom) :- !, projected(F, Vs, Atom).
projected(Atom, [], Atom) :-
    callable(Atom),
    \+ pair(Atom, _, _),
    \+ memberchk(Atom, [neg(_), every(_, _, _), closure(_, _, _, _, _, _), true]).

hidden_positions(Vs, Atom, Positions) :-
    Atom =.. [_|Arguments],
    forall(member(V, Vs), memberchk(V, Arguments)),
    findall(I, ( nth1(I, Arguments, V), memberchk(V, Vs) ), Positions).
