; A hand packs things on a pallet, side by side.
(define (domain pallet)
  (:requirements :strips :negative-preconditions :existential-preconditions :derived-predicates)

  (:predicates
    (Thing ?o)
    (Pose ?o ?p)              ; thing ?o may be at pose ?p
    (Spot ?o ?p)              ; certified: at pose ?p it is on the pallet
    (Reach ?o ?p ?t) (Approach ?t)  ; certified: by approach ?t the hand gets to ?o at ?p, and back
    (Clear ?t ?o ?p)          ; tested: neither the hand nor the thing in it touches ?o at ?p during ?t
    (AtPose ?o ?p) (Holding ?o) (HandEmpty)
    (Packed ?o) (Blocked ?t))

  (:action place
    :parameters (?o ?p ?t)
    :precondition (and (Holding ?o) (Spot ?o ?p) (Reach ?o ?p ?t) (not (Blocked ?t)))
    :effect (and (AtPose ?o ?p) (HandEmpty) (not (Holding ?o))))

  (:action pick
    :parameters (?o ?p ?t)
    :precondition (and (AtPose ?o ?p) (Reach ?o ?p ?t) (HandEmpty) (not (Blocked ?t)))
    :effect (and (Holding ?o) (not (AtPose ?o ?p)) (not (HandEmpty))))

  (:derived (Packed ?o) (exists (?p) (and (Spot ?o ?p) (AtPose ?o ?p))))
  (:derived (Blocked ?t)
    (exists (?o ?p) (and (Approach ?t) (Pose ?o ?p) (AtPose ?o ?p) (not (Clear ?t ?o ?p))))))
