:- module(bridge,
          [ load_report/2,          % +File, -Lines
            answer/3,               % +GoalText, -Status, -Output
            to_file/2,              % +File, +Goal
            message_string/2        % +Error, -Text
          ]).
:- use_module(library(apply), [exclude/3]).

/** <module> What the Python side needs: loading with all complaints collected, and goals as text

    ?- answer('format("hello")', Status, Output).
    Status = true, Output = "hello".

Consulting prints errors and drops the clauses concerned; here the complaints come back as text instead.
*/

:- dynamic collecting/0, complaint/4.

:- multifile user:message_hook/3.
user:message_hook(Term, Kind, Lines) :-
    bridge:collecting,
    memberchk(Kind, [error, warning]),
    bridge:collect(Term, Lines).

collect(Term, Lines) :-
    (   Term = error(_, file(File, Line, Column, _))
    ->  true
    ;   source_location(File, Line)
    ->  Column = -1
    ;   File = '', Line = 0, Column = -1
    ),
    one_line(Lines, Text),
    assertz(complaint(File, Line, Column, Text)).

%!  load_report(+File:atom, -Lines:string) is det.
%
%   Load File. Lines has one line `File TAB Line TAB Column TAB Message` for every error and warning; Line 0 and
%   Column 0 mean "unknown".

load_report(File, Lines) :-
    retractall(complaint(_, _, _, _)),
    setup_call_cleanup(asserta(collecting),
                       catch(user:load_files(File, []), Error, print_message(error, Error)),
                       retractall(collecting)),
    with_output_to(string(Lines),
                   forall(complaint(F, L, C0, Text),
                          ( C is C0 + 1,
                            format("~w\t~w\t~w\t~w~n", [F, L, C, Text]) ))).

%!  answer(+GoalText:atom, -Status, -Output:string) is det.
%
%   Run the goal once in module user. Status is `true`, `false`, `limit`, `input` or `error`; Output is what it
%   printed, the message if there was an error, or `File TAB Line TAB Column TAB Message` if the user's input is
%   at fault.

answer(GoalText, Status, Output) :-
    catch(( term_to_atom(Goal, GoalText),
            with_output_to(string(Output),
                           (   call(user:Goal)
                           ->  Status = true
                           ;   Status = false
                           )) ),
          Error,
          failure(Error, Status, Output)).

failure(error(resource_error(What), _), limit, Output) :-
    !,
    format(string(Output), "not enough ~w", [What]).
failure(error(grammar_error(File, Line, Message), _), input, Output) :-
    !,
    format(string(Output), "~w\t~w\t0\t~s", [File, Line, Message]).
failure(error(notation_error(Column, Message), _), input, Output) :-
    !,
    format(string(Output), "\t0\t~d\t~s", [Column, Message]).
failure(Error, error, Output) :-
    message_string(Error, Output).

%!  to_file(+File:atom, +Goal) is semidet.
%
%   Run the goal once in module user; what it prints, which may be too long for a string, goes to File.

to_file(File, Goal) :-
    current_output(Old),
    setup_call_cleanup(open(File, write, Stream, [encoding(utf8)]),
                       ( set_output(Stream), once(user:Goal) ),
                       ( set_output(Old), close(Stream) )).

%!  message_string(+Error, -Text:string) is det.
%
%   Text says on one line what Prolog would print about Error.

message_string(Error, Text) :-
    catch(phrase(prolog:translate_message(Error), Lines), _, fail),
    !,
    one_line(Lines, Text).
message_string(Error, Text) :-
    format(string(Text), "~p", [Error]).

one_line(Lines, Text) :-
    with_output_to(string(Text0), print_message_lines(current_output, '', Lines)),
    split_string(Text0, "\n", " \t", Parts0),
    exclude(==(""), Parts0, Parts),
    atomic_list_concat(Parts, ' ', Atom),
    atom_string(Atom, Text).
