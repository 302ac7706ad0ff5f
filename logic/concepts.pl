:- module(concepts,
          [ open_concepts/0,
            concept/4,              % ?Name, -Variables, -Sorts, -Formula
            concept_view/4,         % -Concept, -Class, -Cost, -Bits
            vocabulary/3,           % +Text, +Arity, -Found
            read_formula/4          % +Text, -Variable, -Sort, -Formula
          ]).
:- use_module(library(lists), [member/2, nth0/3, nth1/3, permutation/2]).
:- use_module(engine, [shape/3]).
:- use_module(evaluate, [denotation/4]).
:- use_module(facts, [predicate/2, spelling/2]).
:- use_module(notation, [parse_formula/3]).
:- use_module(rules, [concept_at/6, grammar_error/4]).
:- use_module(sorts, [resolve/5]).
:- use_module(views, [class/2]).

/** <module> The words of a domain: predicates, and what the user's grammar says with them

    ?- load_grammars(['docs/examples/05-own-words/home.lp'], Diagnostics), read_facts('tests/logic/cup.pl'),
       vocabulary('HOLDING', 1, Found).
    Diagnostics = [], Found = predicate(holding, [object]).

A grammar file may name a formula, concept("Misplaced(x)", "Red(x) & exists y: On(x,y) & ~Red(y)", 1). Such a
concept is a literal of the given cost wherever it fits. It is a name only: features print, compile and evaluate as the
formula that it stands for.
*/

:- dynamic concept/4.

%!  concept(?Name, -Variables:list, -Sorts:list, -Formula) is nondet.
%
%   Name stands for Formula, whose free Variables are v0 and v1 (as far as used) and of Sorts.

%!  open_concepts is det.
%
%   Read the grammar's concepts against the predicates of the data. A concept may use those before it.
%
%   @error grammar_error(File, Line, Message)

open_concepts :-
    retractall(concept(_, _, _, _)),
    forall(concept_at(Name, Names, Parsed, _, File, Line),
           catch(open_concept(Name, Names, Parsed),
                 error(notation_error(_, Message), _),
                 grammar_error(File, Line, "concept `~w`: ~w", [Name, Message]))).

open_concept(Name, Names, Parsed) :-
    resolve(Parsed, Names, vocabulary, Sorts, Formula),
    findall(V, ( nth0(I, Names, _), atom_concat(v, I, V) ), Variables),
    assertz(concept(Name, Variables, Sorts, Formula)).

%!  vocabulary(+Text:atom, +Arity, -Found) is semidet.
%
%   Text is a concept or predicate as spelled in the data or for people, in any case of letters.

vocabulary(Text, Arity, Found) :-
    same_word(Text, Name, Found0),
    (   Found0 = concept(Name, Variables, Sorts, Formula)
    ->  concept(Name, Variables, Sorts, Formula)
    ;   Found0 = predicate(Name, Sorts),
        predicate(Name, Sorts)
    ),
    length(Sorts, Arity),
    !,
    Found = Found0.

same_word(Text, Name, concept(Name, _, _, _)) :-
    concept(Name, _, _, _),
    same_letters(Text, Name).
same_word(Name, Name, predicate(Name, _)).
same_word(Text, Name, predicate(Name, _)) :-
    predicate(Name, _),
    spelling(Name, Shown),
    ( same_letters(Text, Shown) ; same_letters(Text, Name) ).

same_letters(A, B) :-
    downcase_atom(A, Lower),
    downcase_atom(B, Lower).

%!  concept_view(-Concept, -Class, -Cost, -Bits) is nondet.
%
%   Concept, concept(Name, Positions), can be used as a literal of Class whose variables are its arguments at
%   Positions. Bits is `none` if there is no bit vector of that class.

concept_view(concept(Name, Positions), Class, Cost, Bits) :-
    concept(Name, Variables, Sorts, Formula),
    concept_at(Name, _, _, Cost, _, _),
    findall(I, nth1(I, Sorts, _), All),
    permutation(All, Positions),
    findall(V-T, ( member(I, Positions), nth1(I, Variables, V), nth1(I, Sorts, T) ), Free),
    findall(T, member(_-T, Free), Ts),
    class(Ts, Class),
    (   shape(Class, _, _)
    ->  denotation(Formula, Free, Class, Bits)
    ;   Bits = none
    ).

%!  read_formula(+Text, -Variable, -Sort, -Formula) is det.
%
%   Read the text of a feature (see notation.pl); Variable and Sort are `none` if it is closed.
%
%   @error notation_error(Column, Message)

read_formula(Text, Variable, Sort, Formula) :-
    parse_formula(Text, Free, Parsed),
    resolve(Parsed, [Free], vocabulary, Sorts, Formula),
    (   Sorts = [Sort]
    ->  Variable = v0
    ;   Variable = none,
        Sort = none
    ).
