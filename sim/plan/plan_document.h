// A plan's document, as it is made by hand: tools that it may need put in, steps that were carried out
// written down. Pure, thread-safe.
#pragma once

#include <string>

#include <nlohmann/json_fwd.hpp>

#include "sim/plan/plan_session.h"

namespace kiroku::sim {

/// The document, of which `plan` is the plan, with what a person plans with beside its own tools: two
/// forceps, two graspers, four clips on a body of linear elements, five fingers and a scalpel, each as large
/// as suits the mesh and under a name that is free.
nlohmann::ordered_json with_tools(nlohmann::ordered_json document, const Plan& plan);

/// What read_plan() reads as the plan of the session, to the bit. The session began with the plan of
/// `tooled`, which with_tools() made of `own`. Of the tools that were put in those that no step uses are left
/// out; steps that stand in `own` are taken from there. Not while tools move.
nlohmann::ordered_json document_of(const nlohmann::ordered_json& own, const nlohmann::ordered_json& tooled,
                                   const PlanSession& session, const std::string& name);

}  // namespace kiroku::sim
