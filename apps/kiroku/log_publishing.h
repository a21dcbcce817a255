// The appliance log of a home as a tree that others can follow (witness/tiles.h).
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "apps/kiroku/home.h"
#include "crypto/signed_note.h"
#include "witness/following.h"

namespace kiroku::apps {

/// Brings what is published in `folder` up to date. Nothing is written that does not go on from there.
/// `progress` is told how many leaf hashes were looked at. Throws as witness::follow_log() and
/// witness::read_log_to_show() do.
witness::Followed publish_log(const Home& home, const std::filesystem::path& folder,
                              const std::function<void(std::uint64_t)>& progress = {});

/// What came of it, a sentence.
std::string published_text(const witness::Followed& followed, const std::string& folder);

/// "1 entry"; of none "0 entries".
std::string entries_text(const std::optional<crypto::Checkpoint>& checkpoint);

}  // namespace kiroku::apps
