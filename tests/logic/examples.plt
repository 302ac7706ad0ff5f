:- use_module(library(plunit)).
:- use_module(library(filesex)).
:- use_module('../../logic/bridge').
:- use_module('../../logic/concepts').
:- use_module('../../logic/engine').
:- use_module('../../logic/evaluate').
:- use_module('../../logic/facts').
:- use_module('../../logic/features').
:- use_module('../../logic/formula').
:- use_module('../../logic/generate').
:- use_module('../../logic/notation').
:- use_module('../../logic/pool').
:- use_module('../../logic/rules').
:- use_module('../../logic/sorts').
:- use_module('../../logic/terms').
:- use_module('../../logic/views').

% The examples in the comments of logic/*.pl: indented queries `?- Goal.`, each followed by its (first) answer, the
% values of some of its variables. Paths are relative to the repository.

:- dynamic root/1.
:- prolog_load_context(directory, Here), directory_file_path(Here, '../..', Root), assertz(root(Root)).

module_file(File) :-
    root(Root),
    directory_file_path(Root, 'logic/*.pl', Pattern),
    expand_file_name(Pattern, Files),
    member(File, Files).

% example(+File, -Query, -Expected, -Bindings): Bindings are the names of the variables of both.

example(File, Query, Expected, Bindings) :-
    setup_call_cleanup(open(File, read, In, [encoding(utf8)]), read_string(In, _, Text), close(In)),
    sub_string(Text, Start, _, _, "/** <module>"),
    sub_string(Text, End, _, _, "\n*/"),
    End > Start,
    !,
    Length is End - Start,
    sub_string(Text, Start, Length, _, Comment),
    sub_string(Comment, Before, _, _, "\n    ?- "),
    Begin is Before + 8,
    sub_string(Comment, Begin, _, 0, Rest),
    setup_call_cleanup(open_string(Rest, In2),
                       ( read_term(In2, Query, [variable_names(Asked)]),
                         read_term(In2, Expected, [variable_names(Answered)]) ),
                       close(In2)),
    append(Asked, Answered, Bindings).

% answers(+Bindings, +Expected): what is expected of a variable is its value in the query.

answers(Bindings, (A, B)) :-
    !,
    answers(Bindings, A),
    answers(Bindings, B).
answers(Bindings, Variable = Value) :-
    member(Name=V, Bindings),
    V == Variable,
    !,
    once(( member(Name=Found, Bindings), Found \== Variable )),
    assertion(Found =@= Value).

:- begin_tests(examples).

test(every_module_has_one, [forall(module_file(File)), nondet]) :-
    example(File, _, _, _).

test(answers, [forall(( module_file(File),
                        findall(Q-E-B, example(File, Q, E, B), All),
                        member(Query-Expected-Bindings, All) )),
               nondet]) :-
    root(Root),
    working_directory(Old, Root),
    call_cleanup(with_output_to(string(_), once(user:Query)), working_directory(_, Old)),
    answers(Bindings, Expected).

:- end_tests(examples).
