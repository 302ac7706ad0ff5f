:- module(notation,
          [ parse_formula/3,        % +Text, -Free, -Parsed
            parse_concept/4,        % +HeadText-Text, -Name, -Variables, -Parsed
            resolve/5,              % +Parsed, +Names, +Lookup, -Sorts, -Formula
            connective/2,           % +Formula, -Parts
            fresh/3,                % +N0, -Variable, -N
            bind_some/3,            % +Variables, +Formula, -Bound
            rename/5,               % +Formula, +Substitution, -Renamed, +N0, -N
            formula_cost/3          % +Formula, +Hidden, -Cost
          ]).
:- use_module(library(lists), [append/3, member/2, nth1/3]).
:- use_module(library(apply), [foldl/4, foldl/6, maplist/3]).

/** <module> Formulas as people write them

    exists r: On(x,r) & Tray(r) & ~(Red(x) => Red(r))          ASCII
    ∃r On(x,r) ∧ Tray(r) ∧ ¬(Red(x) ⇒ Red(r))                  the way features are printed

Precedence, from strong to weak: ¬, ∧, ∨, ⇒ (to the right); a quantifier reaches as far as it can. `_` stands
for "some entity" in its atom. A formula may start with `#x:` ("how many x") to say which variable is counted;
otherwise it is the one that no quantifier binds. {u,w | F}⁺(y,x) is the transitive closure of the relation F.

Reading has two steps. parse_formula/3 knows the syntax only. resolve/5 knows the predicates: it finds the sort
of every variable and writes the formula with the pool's variables v0, v1 ...

Complaints are error(notation_error(Column, Message), _).
*/

%!  parse_formula(+Text, -Free, -Parsed) is det.
%
%   Free is the name of the counted variable if Text names it, else `auto`. Parsed has the pool's connectives,
%   quantifiers some(Name, F) and every(Name, F), and atoms atom(Predicate, Names, Column).
%
%   @error notation_error(Column, Message)

parse_formula(Text, Free, Parsed) :-
    tokens_of(Text, Tokens),
    phrase(counted(Free), Tokens, Tokens1),
    phrase(implication(Parsed), Tokens1, Tokens2),
    phrase(end, Tokens2, _).

%!  parse_concept(+HeadAndText, -Name, -Variables:list, -Parsed) is det.
%
%   HeadAndText is e.g. "Misplaced(x)"-"Red(x) & ...".
%
%   @error notation_error(Column, Message)

parse_concept(Head-Text, Name, Variables, Parsed) :-
    tokens_of(Head, HeadTokens),
    phrase(implication(HeadParsed), HeadTokens, HeadTokens1),
    phrase(end, HeadTokens1, _),
    (   HeadParsed = atom(Name, Variables, _),
        \+ memberchk('_', Variables),
        sort(Variables, Distinct),
        same_length(Variables, Distinct)
    ->  true
    ;   complain(1, "the head of a concept is a name with different variables, like Misplaced(x)", [])
    ),
    length(Variables, Arity),
    (   Arity =< 2
    ->  true
    ;   complain(1, "a concept has at most two arguments", [])
    ),
    parse_formula(Text, _, Parsed).

complain(Column, Format, Arguments) :-
    format(string(Message), Format, Arguments),
    throw(error(notation_error(Column, Message), _)).

% ---- Tokens: tok(Token, Column)

tokens_of(Text, Tokens) :-
    string_codes(Text, Codes),
    tokens(Codes, 1, Tokens).

tokens([], Column, [tok(end, Column)]) :- !.
tokens([C|Codes], Column, Tokens) :-
    code_type(C, space),
    !,
    Column1 is Column + 1,
    tokens(Codes, Column1, Tokens).
tokens(Codes, Column, [tok(Token, Column)|Tokens]) :-
    symbol(Text, Token),
    string_codes(Text, Symbol),
    append(Symbol, Rest, Codes),
    !,
    length(Symbol, Length),
    Column1 is Column + Length,
    tokens(Rest, Column1, Tokens).
tokens([C|Codes], Column, [tok(Token, Column)|Tokens]) :-
    name_start(C),
    !,
    name_rest(Codes, NameRest, Rest),
    ( C == 0'? -> NameCodes = NameRest ; NameCodes = [C|NameRest] ),
    atom_codes(Name, NameCodes),
    ( word(Name, Token0) -> Token = Token0 ; Token = name(Name) ),
    length([C|NameRest], Length),
    Column1 is Column + Length,
    tokens(Rest, Column1, Tokens).
tokens([C|_], Column, _) :-
    complain(Column, "`~c` is not part of the notation", [C]).

symbol("⇒", implies).
symbol("=>", implies).
symbol("->", implies).
symbol("∧", and).
symbol("/\\", and).
symbol("&", and).
symbol("∨", or).
symbol("\\/", or).
symbol("|", or).
symbol("¬", not).
symbol("~", not).
symbol("!", not).
symbol("∃", some).
symbol("∀", every).
symbol("⊤", true).
symbol("⁺", plus).
symbol("+", plus).
symbol("(", '(').
symbol(")", ')').
symbol("{", '{').
symbol("}", '}').
symbol(",", ',').
symbol(":", ':').
symbol(".", ':').
symbol("#", '#').

word(exists, some).
word(some, some).
word(forall, every).
word(every, every).
word(and, and).
word(or, or).
word(not, not).
word(implies, implies).
word(true, true).

name_start(C) :- code_type(C, csymf), !.
name_start(0'?).

% PDDL names have hyphens, but x->y is an implication.
name_rest([0'-,C|Codes], [0'-,C|Name], Rest) :-
    code_type(C, csym),
    !,
    name_rest(Codes, Name, Rest).
name_rest([C|Codes], [C|Name], Rest) :-
    code_type(C, csym),
    !,
    name_rest(Codes, Name, Rest).
name_rest(Rest, [], Rest).

% ---- Syntax

counted(Name) --> [tok('#', _)], !, name(Name), optional(':').
counted(auto) --> [].

implication(F) -->
    disjunction(A),
    (   [tok(implies, _)]
    ->  implication(B),
        { F = implies(A, B) }
    ;   { F = A }
    ).

disjunction(F) --> conjunction(A), disjunction(A, F).

disjunction(A, F) --> [tok(or, _)], !, conjunction(B), disjunction(disj(A, B), F).
disjunction(F, F) --> [].

conjunction(F) --> unary(A), conjunction(A, F).

conjunction(A, F) --> [tok(and, _)], !, unary(B), conjunction(conj(A, B), F).
conjunction(F, F) --> [].

unary(neg(F)) --> [tok(not, _)], !, unary(F).
unary(F) --> [tok(some, _)], !, names(Names), optional(':'), implication(A), { quantify(Names, some, A, F) }.
unary(F) --> [tok(every, _)], !, names(Names), optional(':'), implication(A), { quantify(Names, every, A, F) }.
unary(F) --> [tok('(', _)], !, implication(F), expect(')').
unary(true) --> [tok(true, _)], !.
unary(closure(U, W, F, Y, X)) -->
    [tok('{', _)],
    !,
    name(U), expect(','), name(W), expect(or), implication(F), expect('}'), expect(plus),
    expect('('), name(Y), expect(','), name(X), expect(')').
unary(atom(Name, Arguments, Column)) -->
    peek(Column),
    name(Name),
    (   [tok('(', _)]
    ->  names(Arguments),
        expect(')')
    ;   { Arguments = [] }
    ).

quantify([], _, F, F).
quantify([Name|Names], Quantifier, A, F) :-
    F =.. [Quantifier, Name, B],
    quantify(Names, Quantifier, A, B).

names([Name|Names]) -->
    name(Name),
    (   [tok(',', _)]
    ->  names(Names)
    ;   { Names = [] }
    ).

name(Name) --> [tok(name(Name), _)], !.
name(_) --> [tok(Token, Column)], { found(Token, Found), complain(Column, "expected a name instead of ~w", [Found]) }.

peek(Column), [tok(Token, Column)] --> [tok(Token, Column)].

optional(Token) --> [tok(Token, _)], !.
optional(_) --> [].

expect(Token) --> [tok(Token, _)], !.
expect(Token) -->
    [tok(Other, Column)],
    { found(Token, Wanted),
      found(Other, Found),
      complain(Column, "expected ~w instead of ~w", [Wanted, Found]) }.

end --> [tok(end, _)], !.
end --> [tok(Token, Column)], { found(Token, Found), complain(Column, "the formula should end before ~w", [Found]) }.

found(end, "the end") :- !.
found(name(Name), Text) :- !, format(string(Text), "`~w`", [Name]).
found(Token, Text) :- symbol(Symbol, Token), !, format(string(Text), "`~w`", [Symbol]).

% ---- Sorts

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
    foldl([Name, Name-v(V, _), N0, N]>>fresh(N0, V, N), Names, Environment, 0, Next),
    read_formula(Parsed, Environment, Lookup, Formula, Next, _),
    maplist([Name-v(_, Sort), Sort]>>known_sort(Name, Sort), Environment, Sorts).

known_sort(Name, Sort) :-
    (   var(Sort)
    ->  complain(1, "no predicate says what variable `~w` stands for", [Name])
    ;   true
    ).

%!  fresh(+N0, -Variable, -N) is det.
%
%   Variable is the pool's variable number N0.

fresh(N0, V, N) :-
    atom_concat(v, N0, V),
    N is N0 + 1.

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
    two(Pair, F, G),
    (   free_name(F, Bound, Name)
    ;   free_name(G, Bound, Name)
    ).

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

two(conj(F, G), F, G).
two(disj(F, G), F, G).
two(implies(F, G), F, G).

read_formula(true, _, _, true, N, N) :- !.
read_formula(neg(A), E, Lookup, neg(F), N0, N) :-
    !,
    read_formula(A, E, Lookup, F, N0, N).
read_formula(Pair, E, Lookup, Result, N0, N) :-
    two(Pair, A, B),
    !,
    read_formula(A, E, Lookup, F, N0, N1),
    read_formula(B, E, Lookup, G, N1, N),
    functor(Pair, Connective, 2),
    Result =.. [Connective, F, G].
read_formula(some(Name, A), E, Lookup, some(V, Sort, F), N0, N) :-
    !,
    bind(Name, A, E, Lookup, V, Sort, F, N0, N).
read_formula(every(Name, A), E, Lookup, every(V, Sort, F), N0, N) :-
    !,
    bind(Name, A, E, Lookup, V, Sort, F, N0, N).
read_formula(closure(UName, WName, A, YName, XName), E, Lookup, closure(U, W, Sort, F, Y, X), N0, N) :-
    !,
    fresh(N0, U, N1),
    fresh(N1, W, N2),
    read_formula(A, [UName-v(U, Sort), WName-v(W, Sort)|E], Lookup, F, N2, N),
    known_sort(UName, Sort),
    end_of_closure(YName, E, Sort, Y),
    end_of_closure(XName, E, Sort, X).
read_formula(atom(Text, Arguments, Column), E, Lookup, F, N0, N) :-
    length(Arguments, Arity),
    (   call(Lookup, Text, Arity, Found)
    ->  true
    ;   complain(Column, "there is no predicate `~w` with ~d argument(s)", [Text, Arity])
    ),
    signature(Found, Sorts),
    argument_terms(Arguments, Sorts, E, Text, Column, Vs, Wild, N0, N1),
    applied(Found, Vs, Atom, N1, N),
    bind_some(Wild, Atom, F).

%!  bind_some(+Variables:list, +Formula, -Bound) is det.
%
%   Bound says that Formula holds for some Variables (pairs Variable-Sort), the first one outermost.

bind_some([], F, F).
bind_some([V-Sort|Variables], F0, some(V, Sort, F)) :-
    bind_some(Variables, F0, F).

bind(Name, A, E, Lookup, V, Sort, F, N0, N) :-
    fresh(N0, V, N1),
    read_formula(A, [Name-v(V, Sort)|E], Lookup, F, N1, N),
    known_sort(Name, Sort).

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

argument_terms([], [], _, _, _, [], [], N, N).
argument_terms([Name|Names], [Sort|Sorts], E, Text, Column, [V|Vs], Wild, N0, N) :-
    (   Name == '_'
    ->  fresh(N0, V, N1),
        Wild = [V-Sort|Wild1]
    ;   memberchk(Name-v(V, Sort0), E),
        (   Sort0 = Sort
        ->  true
        ;   complain(Column, "variable `~w` cannot be that argument of ~w: it is of sort ~w, not ~w",
                     [Name, Text, Sort0, Sort])
        ),
        N1 = N0,
        Wild = Wild1
    ),
    argument_terms(Names, Sorts, E, Text, Column, Vs, Wild1, N1, N).

applied(predicate(Name, _), Vs, Atom, N, N) :-
    Atom =.. [Name|Vs].
applied(concept(_, Variables, _, Formula), Vs, F, N0, N) :-
    foldl([Old, New, S, [Old-New|S]]>>true, Variables, Vs, [], Substitution),
    rename(Formula, Substitution, F, N0, N).

%!  rename(+Formula, +Substitution:list, -Renamed, +N0, -N) is det.
%
%   Replace free variables by Substitution and bound ones by fresh ones.

rename(true, _, true, N, N) :- !.
rename(neg(A), S, neg(F), N0, N) :-
    !,
    rename(A, S, F, N0, N).
rename(Pair, S, Result, N0, N) :-
    two(Pair, A, B),
    !,
    rename(A, S, F, N0, N1),
    rename(B, S, G, N1, N),
    functor(Pair, Connective, 2),
    Result =.. [Connective, F, G].
rename(some(V0, Sort, A), S, some(V, Sort, F), N0, N) :-
    !,
    fresh(N0, V, N1),
    rename(A, [V0-V|S], F, N1, N).
rename(every(V0, Sort, A), S, every(V, Sort, F), N0, N) :-
    !,
    fresh(N0, V, N1),
    rename(A, [V0-V|S], F, N1, N).
rename(closure(U0, W0, Sort, A, Y0, X0), S, closure(U, W, Sort, F, Y, X), N0, N) :-
    !,
    fresh(N0, U, N1),
    fresh(N1, W, N2),
    rename(A, [U0-U, W0-W|S], F, N2, N),
    memberchk(Y0-Y, S),
    memberchk(X0-X, S).
rename(Atom0, S, Atom, N, N) :-
    Atom0 =.. [Name|Vs0],
    maplist([V0, V]>>memberchk(V0-V, S), Vs0, Vs),
    Atom =.. [Name|Vs].

% ---- Cost

:- meta_predicate formula_cost(+, 2, -).

%!  formula_cost(+Formula, :Hidden, -Cost) is det.
%
%   The larger of the number of literals (and one for closing a formula or a relation, or for an implication that is
%   not the body of a universal quantifier) and of the number of variables, as in the grammar. Hidden is called with an
%   atom and the positions of its variables that occur nowhere else; they are not counted if it succeeds.

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
quantified(Pair) :- two(Pair, F, G), ( quantified(F) ; quantified(G) ).

measure(true, _, 0, 0) :- !.
measure(neg(F), Hidden, L, V) :- !, measure(F, Hidden, L, V).
measure(Pair, Hidden, L, V) :-
    two(Pair, F, G),
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
    \+ two(Atom, _, _),
    \+ memberchk(Atom, [neg(_), every(_, _, _), closure(_, _, _, _, _, _), true]).

hidden_positions(Vs, Atom, Positions) :-
    Atom =.. [_|Arguments],
    forall(member(V, Vs), memberchk(V, Arguments)),
    findall(I, ( nth1(I, Arguments, V), memberchk(V, Vs) ), Positions).
