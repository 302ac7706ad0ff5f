; Parcels of many widths lie on a belt. One of several bins is under its end; they drop into it if it is for their width.
(define (domain belt)
  (:requirements :strips)

  (:predicates
    (Parcel ?p) (Bin ?b)
    (Fits ?p ?b)              ; tested: bin ?b is for parcels as wide as ?p
    (Waiting ?p) (In ?p ?b) (Under ?b))

  (:action drop
    :parameters (?p ?b)
    :precondition (and (Waiting ?p) (Under ?b) (Fits ?p ?b))
    :effect (and (In ?p ?b) (not (Waiting ?p))))

  (:action change
    :parameters (?from ?to)
    :precondition (and (Under ?from) (Bin ?to))
    :effect (and (Under ?to) (not (Under ?from)))))
