#include "viewer/api/playback_store.h"

#include <atomic>
#include <future>

#include <gtest/gtest.h>

#include "tests/support/eventually.h"
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

// As one on a network does whose server is away.
TEST(PlaybackStore, ALockedSessionsKeysGoThoughAnArchiveHangs) {
  test::SampleArchive archive;
  const std::filesystem::path folder = test::SampleCase::write(archive);
  const test::TemporaryFolder copies;
  test::MovedClock clock;
  std::promise<void> answers;
  const std::shared_future<void> answered = answers.get_future().share();
  std::atomic<bool> hangs = false, is_asked = false;
  PlaybackStore store(copies / "copies", 1U << 20U, clock, [&](const std::filesystem::path& file) {
    if (hangs) {
      is_asked = true;
      answered.wait();
    }
    return file_stamp(file);
  });
  const Watcher surgeon("haru", archive, clock);
  const std::weak_ptr<playback::CasePlayback> watched =
      store.open(surgeon.session, surgeon.identities, folder);
  hangs = true;
  const auto after_seconds = [&](const auto& holds) {
    return test::eventually([&] {
      clock.move(std::chrono::seconds(1));
      return holds();
    });
  };
  EXPECT_TRUE(after_seconds([&] { return is_asked.load(); }));
  EXPECT_FALSE(watched.expired());
  surgeon.session->lock();
  EXPECT_TRUE(after_seconds([&] { return watched.expired(); }));
  answers.set_value();
}

}  // namespace
}  // namespace kiroku::viewer
