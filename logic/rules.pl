:- module(rules,
          [ load_grammars/2,        % +Files, -Diagnostics
            grammar_rule/7,         % ?Index, ?Name, ?Operands, ?Result, ?Cost, ?Commutative, ?Implications
            sem/5,                  % +Name, +OperandClasses, +ResultClass, +Operands, -Denotation
            says/5,                 % +Name, +OperandClasses, +Operands, +Variables, -Formula
            bound/3,                % ?Name, ?OperandBounds, ?Bound
            cap/2,                  % ?What, ?Limit
            op(200, xfx, @)         % Operand@Variables, in says/5
          ]).
:- use_module(library(lists), [member/2, nth1/3]).
:- use_module(engine).
:- use_module(bridge, [message_string/2]).

/** <module> Reading grammar files safely

A grammar may come from a stranger. It is never consulted: each term is read, and only the clauses that
grammar.lp describes are accepted; the body of a sem/5 clause may call the engine's primitives and nothing
else, so a grammar can compute denotations but not reach a file, a shell or itself.

Whatever is wrong is collected as diagnostic(File, Line, Column, Message).
*/

:- dynamic
    sem/5, says/5, bound/3, cap/2,
    grammar_rule/7,
    rule_at/6,                  % Name, Operands, Result, Cost, File, Line
    clause_at/4,                % Kind, Name, File, Line
    commutative/1, implication/1, off/1,
    found/1.

%!  grammar_rule(?Index, ?Name, ?Operands, ?Result, ?Cost, ?Commutative, ?Implications) is nondet.
%
%   A rule that is switched on: its place in the grammar, its classes, and the notes on it.

%!  sem(+Name, +OperandClasses, +ResultClass, +Operands, -Denotation) is semidet.
%!  says(+Name, +OperandClasses, +Operands, +Variables, -Formula) is semidet.
%!  bound(?Name, ?OperandBounds, ?Bound) is nondet.
%!  cap(?What, ?Limit) is nondet.
%
%   The clauses of the grammar, as grammar.lp describes them.

%!  load_grammars(+Files:list, -Diagnostics:list) is det.
%
%   Replace the grammar by the clauses of all Files. Where Diagnostics is not empty the grammar must not
%   be used.

load_grammars(Files, Diagnostics) :-
    forall(member(Head, [ sem(_,_,_,_,_), says(_,_,_,_,_), bound(_,_,_), cap(_,_),
                          grammar_rule(_,_,_,_,_,_,_), rule_at(_,_,_,_,_,_), clause_at(_,_,_,_),
                          commutative(_), implication(_), off(_), found(_) ]),
           retractall(Head)),
    forall(member(File, Files), read_grammar(File)),
    check_grammar,
    index_rules,
    findall(D, found(D), Diagnostics).

report(File, Line, Column, Format, Arguments) :-
    format(string(Message), Format, Arguments),
    assertz(found(diagnostic(File, Line, Column, Message))).

read_grammar(File) :-
    retractall(cap_of_file(_)),         % a file's own caps add up, and replace those of the files before
    catch(setup_call_cleanup(open(File, read, In, [encoding(utf8)]),
                             read_clauses(In, File),
                             close(In)),
          error(Formal, _),
          ( message_text(Formal, Text),
            report(File, 0, 0, "~w", [Text]) )).

:- dynamic cap_of_file/1.

read_clauses(In, File) :-
    repeat,
    catch(read_one(In, File, Term), Error, (syntax_problem(Error, File), Term = skip)),
    Term == end_of_file,
    !.

read_one(In, File, Term) :-
    read_term(In, Term, [ module(rules), syntax_errors(error), term_position(Position),
                          singletons(Singletons), cycles(false) ]),
    stream_position_data(line_count, Position, Line),
    stream_position_data(line_position, Position, Column0),
    Column is Column0 + 1,
    (   Term == end_of_file
    ->  true
    ;   accept(Term, File, Line, Problem)
    ->  (   var(Problem)
        ->  warn_singletons(Singletons, File, Line, Column)
        ;   report(File, Line, Column, "~w", [Problem])
        )
    ;   functor_text(Term, What),
        report(File, Line, Column, "a grammar cannot contain `~w`", [What])
    ).

syntax_problem(error(syntax_error(What), Where), File) :-
    !,
    (   Where = stream(_, Line, Column0, _)
    ->  Column is Column0 + 1
    ;   Where = file(_, Line, Column0, _)
    ->  Column is Column0 + 1
    ;   Line = 0, Column = 0
    ),
    message_text(syntax_error(What), Text),
    report(File, Line, Column, "~w", [Text]).
syntax_problem(error(Formal, _), File) :-
    message_text(Formal, Text),
    report(File, 0, 0, "~w", [Text]).

message_text(existence_error(source_sink, _), "file not found") :- !.
message_text(permission_error(_, _, _), "file cannot be read") :- !.
message_text(Formal, Text) :-
    message_string(error(Formal, _), Text).

functor_text((:- _), ":- directive") :- !.
functor_text((Head :- _), Text) :- !, functor_text(Head, Text).
functor_text(Term, Text) :-
    callable(Term),
    !,
    functor(Term, Name, Arity),
    format(string(Text), "~q/~d", [Name, Arity]).
functor_text(Term, Text) :-
    format(string(Text), "~q", [Term]).

% A variable that occurs once and does not start with _ is a typing mistake more often than not.
warn_singletons([], _, _, _).
warn_singletons([Name=_|_], File, Line, Column) :-
    report(File, Line, Column, "variable `~w` occurs only once; write `_` if that is meant", [Name]).

% accept(+Term, +File, +Line, -Problem): store a clause of a known kind; Problem stays unbound if it is good.

accept(rule(Name, Operands, Result, Cost), File, Line, Problem) :-
    !,
    (   rule_problem(Name, Operands, Result, Cost, Problem)
    ->  true
    ;   assertz(rule_at(Name, Operands, Result, Cost, File, Line))
    ).
accept((sem(Name, Classes, Class, Operands, D) :- Body), File, Line, Problem) :-
    !,
    (   \+ atom(Name)
    ->  Problem = "the name of a rule must be an atom"
    ;   body_problem(Body, Problem)
    ->  true
    ;   assertz((sem(Name, Classes, Class, Operands, D) :- Body)),
        assertz(clause_at(sem, Name, File, Line))
    ).
accept(sem(Name, Classes, Class, Operands, D), File, Line, Problem) :-
    !,
    (   atom(Name)
    ->  assertz(sem(Name, Classes, Class, Operands, D)),
        assertz(clause_at(sem, Name, File, Line))
    ;   Problem = "the name of a rule must be an atom"
    ).
accept(says(Name, Classes, Operands, Variables, Formula), File, Line, Problem) :-
    !,
    (   atom(Name)
    ->  assertz(says(Name, Classes, Operands, Variables, Formula)),
        assertz(clause_at(says, Name, File, Line))
    ;   Problem = "the name of a rule must be an atom"
    ).
accept(bound(Name, Bounds, Bound), File, Line, _) :-
    atom(Name), is_list(Bounds),
    assertz(bound(Name, Bounds, Bound)),
    assertz(clause_at(bound, Name, File, Line)).
accept(cap(What, Limit), _, _, _) :-
    atom(What), integer(Limit),
    (   cap_of_file(What)
    ->  true
    ;   retractall(cap(What, _)),
        assertz(cap_of_file(What))
    ),
    assertz(cap(What, Limit)).
accept(commutative(Name), File, Line, _) :-
    atom(Name),
    assertz(commutative(Name)),
    assertz(clause_at(commutative, Name, File, Line)).
accept(implication(Name), File, Line, _) :-
    atom(Name),
    assertz(implication(Name)),
    assertz(clause_at(implication, Name, File, Line)).
accept(off(Name), File, Line, _) :-
    atom(Name),
    assertz(off(Name)),
    assertz(clause_at(off, Name, File, Line)).

rule_problem(Name, _, _, _, "the name of a rule must be an atom") :-
    \+ atom(Name),
    !.
rule_problem(Name, _, _, _, Problem) :-
    rule_at(Name, _, _, _, _, Line),
    !,
    format(string(Problem), "rule `~w` exists already (line ~d)", [Name, Line]).
rule_problem(_, Operands, _, _, "the operands of a rule are a list of one or two classes") :-
    \+ ( is_list(Operands), length(Operands, N), between(1, 2, N) ),
    !.
rule_problem(_, Operands, Result, _, Problem) :-
    member(Class, [Result|Operands]),
    \+ known_class(Class),
    !,
    format(string(Problem), "unknown class `~p`", [Class]).
rule_problem(_, _, _, Cost, "the cost of a rule is a natural number") :-
    \+ ( integer(Cost), Cost >= 0 ),
    !.
rule_problem(_, [Class], Result, 0, "a rule from a class to itself must cost at least 1") :-
    nonvar(Class), nonvar(Result),
    functor(Class, F, N),
    functor(Result, F, N).

known_class(Class) :- var(Class).
known_class(prop).
known_class(con(_)).
known_class(role(_, _)).
known_class(imp(_)).
known_class(triple(_, _, _)).
known_class(pred(_)).
known_class(link(_)).
known_class(own(_)).
known_class(test(_)).

body_problem(Body, "the body calls a variable") :-
    var(Body),
    !.
body_problem((A, B), Problem) :-
    !,
    (   body_problem(A, Problem)
    ->  true
    ;   body_problem(B, Problem)
    ).
body_problem(Goal, Problem) :-
    \+ primitive(Goal),
    functor_text(Goal, Text),
    format(string(Problem), "`~w` is not a primitive of the engine", [Text]).

% Every rule needs a meaning and a text; every other clause needs its rule.

check_grammar :-
    forall(( rule_at(Name, _, _, _, File, Line),
             member(Kind/What, [sem/"sem/5 clause (its meaning)", says/"says/5 clause (its formula)"]),
             \+ clause_at(Kind, Name, _, _) ),
           report(File, Line, 1, "rule `~w` has no ~s", [Name, What])),
    forall(( clause_at(Kind, Name, File, Line),
             \+ rule_at(Name, _, _, _, _, _) ),
           report(File, Line, 1, "`~w` speaks of the rule `~w`, which does not exist", [Kind, Name])),
    forall(( rule_at(Name, _, _, _, File, Line), commutative(Name) ),
           (   rule_at(Name, [A,B], _, _, _, _), A =@= B
           ->  true
           ;   report(File, Line, 1, "rule `~w` cannot be commutative: it needs two operands of one class",
                      [Name])
           )).

% Rules get their number in file order (which is the order of preference) and are tried by result class:
% formulas with more variables first, because rules of cost 0 turn them into those with fewer.

index_rules :-
    findall(Name-rule(Operands, Result, Cost),
            ( rule_at(Name, Operands, Result, Cost, _, _),
              \+ off(Name) ),
            Rules),
    forall(nth1(Index, Rules, Name-rule(Operands, Result, Cost)),
           ( ( commutative(Name) -> Commutative = true ; Commutative = false ),
             ( implication(Name) -> Implications = 1 ; Implications = 0 ),
             assertz(grammar_rule(Index, Name, Operands, Result, Cost, Commutative, Implications)) )).
