#include "viewer/api/playback_store.h"

#include <gtest/gtest.h>

#include "tests/support/moved_clock.h"
#include "tests/support/sample_case.h"

namespace kiroku::viewer {
namespace {

/// Somebody who watches cases: they stay open as long as the store keeps them.
struct Watcher {
  Watcher(const std::string& name, const test::SampleArchive& archive, const Clock& clock)
      : session(std::make_shared<Session>(name, Role::kSurgeon, std::nullopt,
                                          clock.now() + std::chrono::hours(1), nullptr, false, clock)),
        identities(std::make_shared<const crypto::AgeIdentities>(archive.identities())) {
    session->unlock(identities);
  }
  std::shared_ptr<Session> session;
  Session::Identities identities;
};

TEST(PlaybackStore, OnePersonsManyCasesPushNobodyElsesOut) {
  test::SampleArchive archive;
  const std::filesystem::path folder = test::SampleCase::write(archive);
  const test::TemporaryFolder other_names;
  const test::MovedClock clock;
  PlaybackStore store(other_names / "copies", 1U << 20U, clock);
  const auto another_case = [&](int number) {
    std::filesystem::path copy = other_names / std::to_string(number);
    std::filesystem::copy(folder, copy, std::filesystem::copy_options::recursive);
    return copy;
  };
  const Watcher surgeon("haru", archive, clock), greedy("aki", archive, clock), again("aki", archive, clock);
  const auto watched = store.open(surgeon.session, surgeon.identities, folder);
  std::vector<std::filesystem::path> cases;
  std::vector<PlaybackStore::Playback> playbacks;
  for (int i = 0; i < 2 * static_cast<int>(PlaybackStore::kMostOpen); ++i) {
    const Watcher& who = i % 2 == 0 ? greedy : again;  // from two browsers: it is one person
    cases.push_back(another_case(i));
    playbacks.push_back(store.open(who.session, who.identities, cases.back()));
  }
  EXPECT_EQ(store.open(surgeon.session, surgeon.identities, folder), watched) << "was pushed out";
  EXPECT_EQ(store.open(again.session, again.identities, cases.back()), playbacks.back());
  EXPECT_NE(store.open(greedy.session, greedy.identities, cases.front()), playbacks.front())
      << "the greedy one's oldest made room";
}

}  // namespace
}  // namespace kiroku::viewer
