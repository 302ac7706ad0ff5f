:- module(sorts,
          [ resolve/5               % +Parsed, +Names, +Lookup, -Sorts, -Formula
          ]).
:- use_module(library(apply), [foldl/5, maplist/3]).
:- use_module(library(lists), [list_to_set/2, member/2]).
:- autoload(library(yall), [(>>)/4, (>>)/6]).
:- use_module(notation, [complain/3]).
:- use_module(terms, [bind_some/3, fresh//1, pair/3, rename//3]).

/** <module> Parsed formulas become the pool's: names are looked up, and every variable has a sort

    ?- resolve(some(r, atom('On', [x,r], 11)), [auto], [_, _, predicate(on, [object,object])]>>true, Sorts, Formula).
    Sorts = [object], Formula = some(v1, object, on(v0, v1)).

A variable has the sort of the arguments where it stands. Complaints are error(notation_error(Column, Message), _).
*/

:- meta_predicate resolve(+, +, 3, -, -).

%!  resolve(+Parsed, +Names:list, :Lookup, -Sorts:list, -Formula) is det.
%
%   Formula is Parsed with variables v0, v1 ...: first the free ones, Names, whose Sorts are found, then those
%   of quantifiers in order of appearance. Names = [auto] stands for whatever is free, at most one. Lookup is
%   called with a name as written and its number of arguments, and answers predicate(Name, Sorts) or
%   concept(Name, Variables, Sorts, Formula), whose formula replaces the atom.
%
%   @error notation_error(Column, Message)

resolve(Parsed, Names0, Lookup, Sorts, Formula) :-
    free_names(Parsed, Free),
    (   Names0 == [auto]
    ->  Names = Free,
        (   Free = [_,_|_]
        ->  atomic_list_concat(Free, ', ', List),
            complain(1, "at most one variable may be free (it is counted), but ~w are: bind the others with ∃ or ∀",
                     [List])
        ;   true
        )
    ;   Names = Names0,
        (   member(Name, Free),
            \+ memberchk(Name, Names)
        ->  complain(1, "variable `~w` is not bound", [Name])
        ;   true
        )
    ),
    foldl([Name, Name-v(V, _), N0, N]>>fresh(V, N0, N), Names, Environment, 0, Next),
    resolved(Parsed, Environment, Lookup, Formula, Next, _),
    maplist([Name-v(_, Sort), Sort]>>known_sort(Name, Sort), Environment, Sorts).

known_sort(Name, Sort) :-
    (   var(Sort)
    ->  complain(1, "no predicate says what variable `~w` stands for", [Name])
    ;   true
    ).

free_names(Parsed, Names) :-
    findall(Name, free_name(Parsed, [], Name), Names0),
    list_to_set(Names0, Names).

free_name(atom(_, Arguments, _), Bound, Name) :-
    member(Name, Arguments),
    Name \== '_',
    \+ memberchk(Name, Bound).
free_name(some(V, F), Bound, Name) :- free_name(F, [V|Bound], Name).
free_name(every(V, F), Bound, Name) :- free_name(F, [V|Bound], Name).
free_name(closure(U, W, F, Y, X), Bound, Name) :-
    (   free_name(F, [U,W|Bound], Name)
    ;   member(Name, [Y,X]),
        Name \== '_',
        \+ memberchk(Name, Bound)
    ).
free_name(neg(F), Bound, Name) :- free_name(F, Bound, Name).
free_name(Pair, Bound, Name) :-
    pair(Pair, F, G),
    (   free_name(F, Bound, Name)
    ;   free_name(G, Bound, Name)
    ).

% resolved(+Parsed, +Environment, :Lookup, -Formula)//: the state is the number of the next variable. Environment has
% Name-v(Variable, Sort) for the names in scope, the innermost first.

resolved(true, _, _, true) --> !.
resolved(neg(A), E, Lookup, neg(F)) -->
    !,
    resolved(A, E, Lookup, F).
resolved(Pair, E, Lookup, Result) -->
    { pair(Pair, A, B) },
    !,
    resolved(A, E, Lookup, F),
    resolved(B, E, Lookup, G),
    { functor(Pair, Connective, 2),
      Result =.. [Connective,F,G] }.
resolved(some(Name, A), E, Lookup, some(V, Sort, F)) -->
    !,
    bound(Name, A, E, Lookup, v(V, Sort), F).
resolved(every(Name, A), E, Lookup, every(V, Sort, F)) -->
    !,
    bound(Name, A, E, Lookup, v(V, Sort), F).
resolved(closure(UName, WName, A, YName, XName), E, Lookup, closure(U, W, Sort, F, Y, X)) -->
    !,
    fresh(U),
    fresh(W),
    resolved(A, [UName-v(U, Sort), WName-v(W, Sort)|E], Lookup, F),
    { known_sort(UName, Sort),
      end_of_closure(YName, E, Sort, Y),
      end_of_closure(XName, E, Sort, X) }.
resolved(atom(Text, Names, Column), E, Lookup, F) -->
    { length(Names, Arity),
      (   call(Lookup, Text, Arity, Found)
      ->  true
      ;   complain(Column, "there is no predicate `~w` with ~d argument(s)", [Text, Arity])
      ),
      signature(Found, Sorts) },
    arguments(Names, Sorts, E, Text-Column, Variables, Unnamed),
    applied(Found, Variables, Atom),
    { bind_some(Unnamed, Atom, F) }.

bound(Name, A, E, Lookup, v(V, Sort), F) -->
    fresh(V),
    resolved(A, [Name-v(V, Sort)|E], Lookup, F),
    { known_sort(Name, Sort) }.

end_of_closure('_', _, _, _) :-
    complain(1, "the ends of a closure are variables, not `_`", []).
end_of_closure(Name, E, Sort, V) :-
    memberchk(Name-v(V, Sort0), E),
    (   Sort0 = Sort
    ->  true
    ;   complain(1, "variable `~w` of a closure is of another sort", [Name])
    ).

signature(predicate(_, Sorts), Sorts).
signature(concept(_, _, Sorts, _), Sorts).

% arguments(+Names, +Sorts, +Environment, +TextColumn, -Variables, -Unnamed)//: Unnamed are the variables (with their
% sorts) that `_` stands for.

arguments([], [], _, _, [], []) --> [].
arguments(['_'|Names], [Sort|Sorts], E, Atom, [V|Vs], [V-Sort|Unnamed]) -->
    !,
    fresh(V),
    arguments(Names, Sorts, E, Atom, Vs, Unnamed).
arguments([Name|Names], [Sort|Sorts], E, Atom, [V|Vs], Unnamed) -->
    { memberchk(Name-v(V, Sort0), E),
      (   Sort0 = Sort
      ->  true
      ;   Atom = Text-Column,
          complain(Column, "variable `~w` cannot be that argument of ~w: it is of sort ~w, not ~w",
                   [Name, Text, Sort0, Sort])
      ) },
    arguments(Names, Sorts, E, Atom, Vs, Unnamed).

applied(predicate(Name, _), Vs, Atom) -->
    { Atom =.. [Name|Vs] }.
applied(concept(_, Variables, _, Formula), Vs, F) -->
    { foldl([Old, New, S, [Old-New|S]]>>true, Variables, Vs, [], Substitution) },
    rename(Formula, Substitution, F).
