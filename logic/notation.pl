:- module(notation,
          [ parse_formula/3,        % +Text, -Free, -Parsed
            parse_concept/4,        % +HeadText-Text, -Name, -Variables, -Parsed
            describe_formula/3,     % +Formula, +Display, -Text
            complain/3              % +Column, +Format, +Arguments
          ]).
:- use_module(library(lists), [append/3, member/2, same_length/2]).

/** <module> Formulas as people write them, and as they are printed

    ?- parse_formula("exists r: On(x,r) & Tray(r)", Free, Parsed).
    Free = auto, Parsed = some(r, conj(atom('On', [x,r], 11), atom('Tray', [r], 21))).

    ?- describe_formula(some(v1, object, conj(on(v0, v1), tray(v1))), [Name, Name]>>true, Text).
    Text = '∃y on(x,y) ∧ tray(y)'.

One table, operator/5, says how connectives and quantifiers are spelled and how strongly they bind; it serves reading
and printing. So both of these are read, and the second is how features are printed:

    exists r: On(x,r) & Tray(r) & ~(Red(x) => Red(r))
    ∃r On(x,r) ∧ Tray(r) ∧ ¬(Red(x) ⇒ Red(r))

A quantifier reaches as far as it can. `_` stands for "some entity" in its atom. A formula may start with `#x:` ("how
many x") to say which variable is counted; otherwise it is the one that no quantifier binds. {u,w | F}⁺(y,x) is the
transitive closure of the relation F.

Reading here knows the syntax only; sorts.pl finds the sort of every variable and writes the formula with the pool's
variables v0, v1 ... What is printed is read back as the same formula, up to the numbers of variables (they are numbered
in order of appearance) and the grouping of ∧ and ∨: conj(A, conj(B, C)) prints as A ∧ B ∧ C, which is
conj(conj(A, B), C).

Complaints are error(notation_error(Column, Message), _).
*/

%   operator(?Name, ?Fixity, ?Strength, ?Symbols, ?Words)
%
%   Strength grows with how tightly an operator binds; infix(Side) says to which side equal ones are grouped. Symbols
%   and Words are the spellings that are read; the first symbol is printed.

operator(implies, infix(right), 1, ['⇒', =>, ->],    [implies]).
operator(disj,    infix(left),  2, ['∨', \/, '|'],   [or]).
operator(conj,    infix(left),  3, ['∧', /\, &],     [and]).
operator(neg,     prefix,       4, ['¬', ~, !],      [not]).
operator(some,    quantifier,   0, ['∃'],          [exists, some]).
operator(every,   quantifier,   0, ['∀'],          [forall, every]).
operator(true,    constant,     5, ['⊤'],          [true]).

mark('⁺', plus).
mark(+, plus).
mark('(', '(').
mark(')', ')').
mark('{', '{').
mark('}', '}').
mark(',', ',').
mark(:, ':').
mark('.', ':').
mark(#, '#').

symbol(Text, Name) :- operator(Name, _, _, Symbols, _), member(Text, Symbols).
symbol(Text, Mark) :- mark(Text, Mark).

word(Word, Name) :- operator(Name, _, _, _, Words), memberchk(Word, Words).

%!  parse_formula(+Text, -Free, -Parsed) is det.
%
%   Free is the name of the counted variable if Text names it, else `auto`. Parsed has the pool's connectives,
%   quantifiers some(Name, F) and every(Name, F), and atoms atom(Predicate, Names, Column).
%
%   @error notation_error(Column, Message)

parse_formula(Text, Free, Parsed) :-
    tokens_of(Text, Tokens),
    phrase(counted(Free), Tokens, Tokens1),
    phrase(formula(Parsed), Tokens1, Tokens2),
    phrase(end, Tokens2, _).

%!  parse_concept(+HeadAndText, -Name, -Variables:list, -Parsed) is det.
%
%   HeadAndText is e.g. "Misplaced(x)"-"Red(x) & ...".
%
%   @error notation_error(Column, Message)

parse_concept(Head-Text, Name, Variables, Parsed) :-
    tokens_of(Head, HeadTokens),
    phrase(formula(HeadParsed), HeadTokens, HeadTokens1),
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

%!  complain(+Column, +Format, +Arguments) is failure.
%
%   @error notation_error(Column, Message) always

complain(Column, Format, Arguments) :-
    format(string(Message), Format, Arguments),
    throw(error(notation_error(Column, Message), _)).

% ---- Tokens: tok(Token, Column); a token is the name of an operator, a mark, name(Name) or `end`

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
    atom_codes(Text, Symbol),
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

formula(F) --> formula(0, F).

% formula(+Least, -F)//: operators outside brackets bind at least as strongly as Least.

formula(Least, F) --> operand(A), operations(Least, A, F).

operations(Least, A, F) -->
    [tok(Name, _)],
    { operator(Name, infix(Side), Strength, _, _),
      Strength >= Least },
    !,
    { ( Side == left -> Next is Strength + 1 ; Next = Strength ) },
    formula(Next, B),
    { G =.. [Name,A,B] },
    operations(Least, G, F).
operations(_, F, F) --> [].

operand(F) --> [tok(Name, _)], { operator(Name, Fixity, _, _, _) }, operand(Fixity, Name, F), !.
operand(F) --> [tok('(', _)], !, formula(F), expect(')').
operand(closure(U, W, F, Y, X)) -->
    [tok('{', _)],
    !,
    name(U), expect(','), name(W), expect(disj), formula(F), expect('}'), expect(plus),
    expect('('), name(Y), expect(','), name(X), expect(')').
operand(atom(Name, Arguments, Column)) -->
    peek(Column),
    name(Name),
    (   [tok('(', _)]
    ->  names(Arguments),
        expect(')')
    ;   { Arguments = [] }
    ).

operand(prefix, Name, F) --> operand(A), { F =.. [Name,A] }.
operand(quantifier, Name, F) -->
    names(Variables), optional(':'), formula(A),
    { quantify(Variables, Name, A, F) }.
operand(constant, Name, Name) --> [].

quantify([], _, F, F).
quantify([V|Vs], Quantifier, A, F) :-
    F =.. [Quantifier,V,B],
    quantify(Vs, Quantifier, A, B).

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

% ---- Printing

:- meta_predicate describe_formula(+, 2, -).

%!  describe_formula(+Formula, :Display, -Text:atom) is det.
%
%   Text is how people read Formula, whose free variable is v0. Display is called with the name of a predicate and says
%   how to spell it.

describe_formula(Formula, Display, Text) :-
    phrase(text(Formula, 0, Display), Parts),
    atomic_list_concat(Parts, Text).

% text(+Formula, +Least, :Display)//: an operation that binds less strongly than Least stands in brackets.

text(F, Least, Display) -->
    { functor(F, Name, Arity),
      operator(Name, Fixity, Strength, [Symbol|_], _),
      arity(Fixity, Arity) },
    !,
    operation(Fixity, F, Strength, Symbol, Least, Display).
text(closure(U, W, _, F, Y, X), _, Display) -->
    !,
    ['{'], variables([U,W]), [' | '], text(F, 0, Display), ['}⁺('], variables([Y,X]), [')'].
text(Atom, _, Display) -->
    { Atom =.. [Name|Variables],
      call(Display, Name, Shown) },
    [Shown],
    (   { Variables == [] }
    ->  []
    ;   ['('], variables(Variables), [')']
    ).

arity(infix(_), 2).
arity(prefix, 1).
arity(quantifier, 3).
arity(constant, 0).

operation(infix(Side), F, Strength, Symbol, Least, Display) -->
    { arg(1, F, A),
      arg(2, F, B) },
    (   { Strength < Least }
    ->  ['('], infix(Side, A, Symbol, B, Strength, Display), [')']
    ;   infix(Side, A, Symbol, B, Strength, Display)
    ).
operation(prefix, F, Strength, Symbol, _, Display) -->
    { arg(1, F, A) },
    [Symbol],
    text(A, Strength, Display).
operation(quantifier, F, _, Symbol, _, Display) -->
    { functor(F, Name, _),
      bound(Name, F, Variables, Body) },
    [Symbol], variables(Variables), [' '],
    text(Body, 0, Display).
operation(constant, _, _, Symbol, _, _) --> [Symbol].

infix(Side, A, Symbol, B, Strength, Display) -->
    (   { open_ended(A) }
    ->  ['('], text(A, 0, Display), [')']
    ;   { Side == left -> Least = Strength ; Least is Strength + 1 },
        text(A, Least, Display)
    ),
    [' ', Symbol, ' '],
    text(B, Strength, Display).

% open_ended(+Formula): its text ends with the reach of a quantifier, so that nothing may follow it.

open_ended(F) :-
    functor(F, Name, Arity),
    operator(Name, Fixity, _, _, _),
    arity(Fixity, Arity),
    (   Fixity == quantifier
    ->  true
    ;   Fixity \== constant,
        arg(Arity, F, Last),
        open_ended(Last)
    ).

% bound(+Quantifier, +Formula, -Variables, -Body): neighbouring quantifiers of one kind are written once.

bound(Name, F, [V|Vs], Body) :-
    functor(F, Name, 3),
    !,
    arg(1, F, V),
    arg(3, F, F1),
    bound(Name, F1, Vs, Body).
bound(_, Body, [], Body).

variables([V|Vs]) --> { spelled(V, Letter) }, [Letter], more_variables(Vs).

more_variables([]) --> [].
more_variables([V|Vs]) --> [','], variables([V|Vs]).

spelled(V, Letter) :- letter(V, Letter), !.
spelled(V, V).

letter(v0, x).  letter(v1, y).  letter(v2, z).  letter(v3, w).  letter(v4, u).  letter(v5, v).
letter(v6, r).  letter(v7, s).  letter(v8, t).  letter(v9, p).  letter(v10, q).  letter(v11, a).
letter(v12, b).  letter(v13, c).  letter(v14, d).  letter(v15, e).  letter(v16, f).  letter(v17, g).
letter(v18, h).  letter(v19, i).  letter(v20, j).  letter(v21, k).  letter(v22, l).  letter(v23, m).
letter(v24, n).  letter(v25, o).
