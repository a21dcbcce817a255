// The trainer's part of the API (docs/explanation/training.md, "The page").
#pragma once

#include "viewer/http/router.h"
#include "viewer/training/training_room.h"

namespace kiroku::viewer {

/// `room` must outlive the router. Everybody who has signed in may train as the trainee that is
/// bound to them, administrators as everybody.
void add_training_routes(Router& router, TrainingRoom& room);

}  // namespace kiroku::viewer
