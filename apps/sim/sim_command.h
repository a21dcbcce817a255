// 'kiroku sim': what the simulation core does for a person at a terminal.
#pragma once

#include "apps/common/command_line.h"

namespace kiroku::apps {

/// Without what needs libraries of codecs. Returns 'kiroku sim', for these to be added.
Command& add_sim_command(Command& program);

/// Parts of it.
void add_sim_volume_command(Command& sim);
void add_sim_mesh_command(Command& sim);
void add_sim_respire_command(Command& sim);
void add_sim_beam_command(Command& sim);
void add_sim_drr_command(Command& sim);
void add_sim_fit_command(Command& sim);

/// Pictures, which need libraries of codecs.
void add_sim_render_command(Command& sim);
void add_sim_transfer_command(Command& sim);
void add_sim_drr_film_command(Command& sim);
void add_sim_overlay_command(Command& sim);
void add_sim_fit_series_command(Command& sim);
void add_sim_lens_command(Command& sim);

/// 'kiroku respire': a page to work on, with the viewer's server.
void add_respire_command(Command& program);

}  // namespace kiroku::apps
