(define (stream pallet)

  ; Poses of a thing on the pallet: uniform, without end.
  (:stream sample-spot
    :inputs (?o) :domain (Thing ?o)
    :outputs (?p) :certified (and (Pose ?o ?p) (Spot ?o ?p)))

  ; The straight approach from above, if the robot gets there.
  (:stream sample-reach
    :inputs (?o ?p) :domain (Pose ?o ?p)
    :outputs (?t) :certified (and (Reach ?o ?p ?t) (Approach ?t)))

  (:stream test-clear
    :inputs (?t ?o ?p) :domain (and (Approach ?t) (Pose ?o ?p))
    :certified (Clear ?t ?o ?p)))
