// What a person asked of 'kiroku compare'. Plain data.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "apps/kiroku/stamped_file.h"

namespace kiroku::apps {

struct ComparisonRequest {
  std::optional<std::string> named, plan, output, home, stream, by_hand, write_by_hand, made_by, from, to,
      speed, form, share, width, volume, series, transfer, view, zoom, gpu, verified, name, asked_by,
      progress, identity_socket, geometry, fluoroscopy, align_at, polarity, align, field, lens, organ,
      colours, purpose;
  std::vector<std::string> identities, authorities;
  NamedRoots roots;
  bool force = false, json = false, steps = false;
};

}  // namespace kiroku::apps
