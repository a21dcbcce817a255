// Every command of kiroku, once: its name, which program answers it, and who adds it. From this list the
// four programs add theirs, and the small one knows which other to become. Constant expressions;
// thread-safe.
//
// Functions of commands are named in functions that are only evaluated while compiling, so that each program
// links those that it answers and no others.
#pragma once

#include <array>
#include <cstddef>
#include <string_view>

#include "apps/kiroku/commands.h"
#include "apps/kiroku/consent_command.h"
#include "apps/kiroku/fleet_command.h"
#include "apps/kiroku/user_command.h"
#include "apps/kiroku/view_command.h"
#include "apps/quality/quality_command.h"
#include "apps/sim/plan_command.h"
#include "apps/sim/sim_command.h"
#include "apps/train/train_command.h"

namespace kiroku::apps {

/// kiroku itself, kiroku-media, kiroku-sim, or kiroku-full, which answers everything.
enum class AnsweredBy { kSmall, kMedia, kSim, kFull };

struct StatedCommand {
  std::string_view name;
  AnsweredBy by = AnsweredBy::kFull;
  void (*add)(Command& to) = nullptr;  // null: another entry's function adds it, too
};

inline void add_sim_group(Command& program) { add_sim_command(program); }
inline void add_plan_group(Command& program) { add_plan_command(program); }

/// In the order of the help page; completion comes last, so that it knows all others.
struct Commands {
  static consteval auto list() {
    using enum AnsweredBy;
    return std::to_array<StatedCommand>(
        {{"init", kSmall, add_init_command},       {"record", kMedia, add_record_command},
         {"case", kSmall, add_case_command},       {"status", kSmall, add_status_command},
         {"doctor", kMedia, add_doctor_command},   {"boot", kSmall, add_boot_command},
         {"devices", kMedia, add_devices_command}, {"recover", kMedia, add_recover_command},
         {"cases", kSmall, add_cases_command},     {"display", kMedia, add_display_command},
         {"verify", kSmall, add_verify_command},   {"report", kMedia, add_report_command},
         {"export", kMedia, add_export_command},   {"excerpt", kSmall, add_excerpt_command},
         {"erase", kMedia, add_erase_command},     {"hold", kSmall, add_hold_command},
         {"release", kSmall, add_release_command}, {"consent", kSmall, add_consent_command},
         {"renew", kSmall, add_renew_command},     {"seal", kSmall, add_seal_command},
         {"unseal", kSmall, add_unseal_command},   {"stamp", kSmall, add_stamp_command},
         {"token", kSmall, add_token_command},     {"tsa", kSmall, add_tsa_command},
         {"log", kSmall, add_log_command},         {"witness", kSmall, add_witness_command},
         {"ship", kSmall, add_ship_command},       {"fetch", kSmall, add_fetch_command},
         {"fleet", kSmall, add_fleet_command},     {"view", kMedia, add_view_command},
         {"user", kSmall, add_user_command},       {"sim", kSim, add_sim_group},
         {"plan", kSim, add_plan_group},           {"respire", kFull, add_respire_command},
         {"compare", kFull, add_compare_command},  {"train", kFull, add_train_command},
         {"quality", kFull, add_quality_command},  {"completion", kFull, add_completion_command}});
  }
};

/// What stands below 'sim': kiroku-full adds what makes pictures.
struct SimCommands {
  static consteval auto list() {
    using enum AnsweredBy;
    return std::to_array<StatedCommand>({{"volume", kSim, nullptr},
                                         {"mesh", kSim, nullptr},
                                         {"respire", kSim, nullptr},
                                         {"beam", kSim, nullptr},
                                         {"drr", kSim, nullptr},
                                         {"fit", kSim, nullptr},
                                         {"solve", kSim, nullptr},
                                         {"render", kFull, add_sim_render_command},
                                         {"transfer", kFull, add_sim_transfer_command},
                                         {"drr-film", kFull, add_sim_drr_film_command},
                                         {"overlay", kFull, add_sim_overlay_command},
                                         {"fit-series", kFull, add_sim_fit_series_command},
                                         {"lens", kFull, add_sim_lens_command}});
  }
};

/// What stands below 'plan': kiroku-full adds what makes films, takes a home or serves a page.
struct PlanCommands {
  static consteval auto list() {
    using enum AnsweredBy;
    return std::to_array<StatedCommand>({{"check", kSim, nullptr},
                                         {"run", kSim, nullptr},
                                         {"template", kSim, nullptr},
                                         {"adapt", kSim, nullptr},
                                         {"replay", kFull, add_plan_replay_command},
                                         {"seal", kFull, add_plan_seal_commands},
                                         {"verify", kFull, nullptr},
                                         {"pick", kFull, add_plan_pick_command},
                                         {"serve", kFull, add_plan_serve_command}});
  }
};

/// A command without its function, to be looked up by a program that runs.
struct CommandPlace {
  std::string_view name;
  AnsweredBy by = AnsweredBy::kFull;
};
template <std::size_t count>
consteval std::array<CommandPlace, count> places_of(const std::array<StatedCommand, count>& commands) {
  std::array<CommandPlace, count> places;
  for (std::size_t i = 0; i < count; ++i) places[i] = {commands[i].name, commands[i].by};
  return places;
}
inline constexpr auto kCommandPlaces = places_of(Commands::list());
inline constexpr auto kSimPlaces = places_of(SimCommands::list());
inline constexpr auto kPlanPlaces = places_of(PlanCommands::list());

/// Adds those that `Listed` names and `Wanted` accepts, in their order.
template <typename Listed, auto Wanted, std::size_t at = 0>
void add_commands(Command& to) {
  if constexpr (at < Listed::list().size()) {
    if constexpr (Wanted(Listed::list()[at])) {
      constexpr auto add = Listed::list()[at].add;
      add(to);
    }
    add_commands<Listed, Wanted, at + 1>(to);
  }
}

}  // namespace kiroku::apps
