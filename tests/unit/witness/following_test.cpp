#include "witness/following.h"

#include <algorithm>
#include <cerrno>
#include <fstream>
#include <iterator>
#include <string>
#include <utility>
#include <vector>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "crypto/merkle_tree.h"
#include "crypto/note_format.h"
#include "http/server.h"
#include "tests/support/fault_file_system.h"
#include "tests/support/software_hardware_key.h"
#include "tests/support/temporary_folder.h"
#include "witness/tiles.h"

namespace kiroku::witness {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

std::string text_in(const fs::path& file) {
  std::ifstream stream(file, std::ios::binary);
  return std::string(std::istreambuf_iterator<char>(stream), {});
}
void put(const fs::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary | std::ios::trunc) << text;
}

/// A log of numbered lines by one device, as long as is asked for.
class PublishedLog {
 public:
  /// From `parts_at` on its lines are others.
  explicit PublishedLog(const crypto::SigningKey& key, std::uint64_t parts_at = ~0ULL)
      : key_(&key), parts_at_(parts_at) {}
  [[nodiscard]] LogToShow at(std::uint64_t size) const {
    LogToShow log;
    for (std::uint64_t i = 0; i < size; ++i) {
      const std::string line = (i < parts_at_ ? "line " : "another line ") + std::to_string(i);
      log.tree.append(crypto::merkle_leaf_hash(bytes_of(line)));
    }
    log.checkpoint = {"kiroku/or-1/log", size, log.tree.root(size)};
    log.note = crypto::sign_note(log.checkpoint.to_text(), "or-1", *key_);
    return log;
  }

 private:
  const crypto::SigningKey* key_;
  std::uint64_t parts_at_;
};

class FollowingTest : public testing::Test {
 protected:
  Followed follow(const TileSource& source) {
    return follow_log(source, archive::real_file_system(), copy, {device});
  }
  Followed follow(const PublishedLog& published_log, std::uint64_t size) {
    const LogToShow shown = published_log.at(size);
    return follow(*tiles_of(shown));
  }
  Followed follow_folder(const fs::path& where) { return follow(*tiles_in_folder(where)); }
  /// Published anew in a folder of its own.
  fs::path published(const PublishedLog& published_log, std::uint64_t size) {
    const fs::path made = folder.path() / ("published-" + std::to_string(++made_));
    const LogToShow shown = published_log.at(size);
    EXPECT_EQ(follow_log(*tiles_of(shown), archive::real_file_system(), made, {device}).what,
              Following::kBegun);
    return made;
  }

  const test::TemporaryFolder folder;
  const fs::path copy = folder.path() / "copy";
  const crypto::SigningKey key = crypto::SigningKey::generate();
  const crypto::VerifierKey device{"or-1", key.public_key()};
  const PublishedLog log{key};
  int made_ = 0;
  bool moved_ = false;
};

TEST(TilePath, IsThatOfTheSpecification) {
  EXPECT_EQ(tile_path(0, 1234067), "tile/0/x001/x234/067");
  EXPECT_EQ(tile_path(3, 5), "tile/3/005");
  EXPECT_EQ(tile_path(1, 273, 112), "tile/1/273.p/112");
  EXPECT_EQ(tile_path(0, 1000, 1), "tile/0/x001/000.p/1");
}

TEST_F(FollowingTest, FilesOfATreeAreThoseOfTheSpecificationInHoweverManySteps) {
  // C2SP tlog-tiles.md, "Merkle Tree": a tree of 70,000 leaves has 273 full tiles and one of 112 at level 0,
  // one full tile and one of 17 at level 1, one of one hash at level 2.
  const fs::path at_once = published(log, 70'000);
  EXPECT_EQ(fs::file_size(at_once / "tile/0/000"), 8192U);
  EXPECT_EQ(fs::file_size(at_once / "tile/0/272"), 8192U);
  EXPECT_EQ(fs::file_size(at_once / "tile/0/273.p/112"), 112U * 32U);
  EXPECT_EQ(fs::file_size(at_once / "tile/1/000"), 8192U);
  EXPECT_EQ(fs::file_size(at_once / "tile/1/001.p/17"), 17U * 32U);
  EXPECT_EQ(fs::file_size(at_once / "tile/2/000.p/1"), 32U);
  EXPECT_FALSE(fs::exists(at_once / "tile/3"));
  EXPECT_FALSE(fs::exists(at_once / "tile/entries"));

  crypto::MerkleFrontier second;
  const std::string bytes = text_in(at_once / "tile/1/000");
  for (std::size_t at = 0; at < bytes.size(); at += 32) {
    crypto::Sha256Digest hash;
    std::ranges::copy(bytes_of(bytes).subspan(at, hash.size()), hash.begin());
    second.append(hash);
  }
  EXPECT_EQ(second.root(), log.at(65'536).tree.root(65'536));

  for (const std::uint64_t size : {1U, 255U, 256U, 257U, 300U, 65'535U, 65'537U, 70'000U}) {
    const Followed followed = follow(log, size);
    EXPECT_EQ(followed.what, size == 1 ? Following::kBegun : Following::kGoesOn) << size << followed.why;
    EXPECT_EQ(followed.shown->size, size);
  }
  for (const auto& each : fs::recursive_directory_iterator(at_once)) {
    const fs::path name = fs::relative(each.path(), at_once);
    if (!each.is_regular_file()) continue;
    EXPECT_EQ(text_in(copy / name), text_in(each.path())) << name;
  }
  // Beginnings of tiles that are full by now went.
  EXPECT_FALSE(fs::exists(copy / "tile/0/000.p"));
}

TEST_F(FollowingTest, SaysThatNothingCameAndKeepsItsCheckpoint) {
  follow(log, 300);
  const std::string kept = text_in(copy / "checkpoint");
  put(copy / "checkpoint", kept + "\xE2\x80\x94 witness.example/w1 AAAAAAAA\n");
  const std::string cosigned = text_in(copy / "checkpoint");
  EXPECT_EQ(follow(log, 300).what, Following::kSame);
  EXPECT_EQ(text_in(copy / "checkpoint"), cosigned);
}

TEST_F(FollowingTest, AnOlderStateIsToldAndNotTaken) {
  follow(log, 300);
  const Followed followed = follow(log, 200);
  EXPECT_EQ(followed.what, Following::kOlder);
  EXPECT_EQ(followed.kept->size, 300U);
  EXPECT_EQ(followed.shown->size, 200U);
  EXPECT_EQ(follow(log, 301).what, Following::kGoesOn);
}

TEST_F(FollowingTest, ASecondHistoryIsToldWhereItPartsAndKept) {
  struct Case {
    std::uint64_t parts_at, size;
  };
  // Longer, as long, shorter; parted at the beginning, in the middle, at a tile's edge and at the end.
  const Case cases[] = {{0, 400},   {299, 400}, {256, 300}, {0, 300},  {299, 300},
                        {100, 200}, {0, 1},     {255, 256}, {299, 600}};
  follow(log, 300);
  const std::string kept = text_in(copy / "checkpoint");
  for (const Case& each : cases) {
    const Followed followed = follow(PublishedLog(key, each.parts_at), each.size);
    ASSERT_EQ(followed.what, Following::kTwoHistories) << each.parts_at << " " << each.size << followed.why;
    EXPECT_EQ(followed.common, each.parts_at);
    EXPECT_EQ(text_in(copy / "checkpoint"), kept);
    // What was kept of it is a published log by itself, of the other history.
    const Followed evidence = follow_log(*tiles_in_folder(followed.evidence), archive::real_file_system(),
                                         folder.path() / ("again-" + std::to_string(++made_)), {device});
    EXPECT_EQ(evidence.what, Following::kBegun) << evidence.why;
    EXPECT_EQ(evidence.shown->root, followed.shown->root);
  }
  // It does not go away by what is shown later.
  const Followed later = follow(log, 301);
  EXPECT_EQ(later.what, Following::kGoesOn);
  EXPECT_EQ(later.earlier_forks.size(), std::size(cases));
}

TEST_F(FollowingTest, OfOtherHistoriesSomeAreKeptAndEachIsTold) {
  follow(log, 300);
  for (std::uint64_t parts_at = 0; parts_at < 20; ++parts_at) {
    const Followed followed = follow(PublishedLog(key, parts_at), 300);
    EXPECT_EQ(followed.what, Following::kTwoHistories);
    EXPECT_EQ(followed.common, parts_at);
    EXPECT_EQ(followed.evidence.empty(), parts_at >= 16) << parts_at;
    EXPECT_EQ(followed.not_kept, parts_at >= 16 ? "16 others are kept already" : "");
  }
  // What is kept is shown once more.
  const Followed again = follow(PublishedLog(key, 3), 300);
  EXPECT_TRUE(fs::exists(again.evidence / "tile"));
  EXPECT_EQ(again.not_kept, "");
  EXPECT_EQ(again.earlier_forks.size(), 16U);
}

TEST_F(FollowingTest, OfALongHistoryBesideAnotherTheCheckpointIsKeptAlone) {
  follow(log, 300);
  EXPECT_TRUE(fs::exists(follow(PublishedLog(key, 10), 300).evidence / "tile"));
  const Followed followed = follow(PublishedLog(key, 20), (1U << 20) + 1);
  EXPECT_EQ(followed.what, Following::kTwoHistories);
  EXPECT_EQ(followed.common, 20U);
  EXPECT_TRUE(fs::exists(followed.evidence / "checkpoint"));
  EXPECT_FALSE(fs::exists(followed.evidence / "tile"));
  EXPECT_THAT(followed.not_kept, HasSubstr("of its hashes nothing is kept"));
}

TEST_F(FollowingTest, ASecondHistoryIsToldWhereItsEvidenceFindsNoRoom) {
  follow(log, 300);
  const PublishedLog other(key, 100);
  const LogToShow shown = other.at(600);
  // Room for its checkpoint, and not for its tiles; then for nothing.
  for (const std::size_t room : {1U, 0U}) {
    const test::TemporaryFolder elsewhere;
    fs::copy(copy, elsewhere.path() / "copy", fs::copy_options::recursive);
    test::FaultFileSystem full(elsewhere.path());
    full.fail("write", ENOSPC, room);
    const Followed followed = follow_log(*tiles_of(shown), full, elsewhere.path() / "copy", {device});
    EXPECT_EQ(followed.what, Following::kTwoHistories);
    EXPECT_EQ(followed.common, 100U);
    EXPECT_EQ(followed.evidence.empty(), room == 0);
    EXPECT_THAT(followed.not_kept, HasSubstr("No space left on device"));
  }
}

TEST_F(FollowingTest, EvidenceThatWasCutOffIsMadeWholeTheNextTime) {
  follow(log, 300);
  const LogToShow shown = PublishedLog(key, 100).at(600);
  const auto keeps = [&](archive::FileSystem& files, const fs::path& where) {
    return follow_log(*tiles_of(shown), files, where, {device});
  };
  // What is kept is the history itself, which others can follow.
  const auto expect_whole = [&](const Followed& followed) {
    EXPECT_EQ(followed.not_kept, "");
    const Followed evidence = follow_log(*tiles_in_folder(followed.evidence), archive::real_file_system(),
                                         folder.path() / ("again-" + std::to_string(++made_)), {device});
    EXPECT_EQ(evidence.what, Following::kBegun) << evidence.why;
    EXPECT_EQ(evidence.shown->root, shown.checkpoint.root);
    EXPECT_FALSE(fs::exists(followed.evidence / ".beginning"));
  };
  std::size_t calls = 0;
  {
    const test::TemporaryFolder elsewhere;
    fs::copy(copy, elsewhere.path() / "copy", fs::copy_options::recursive);
    test::FaultFileSystem counted(elsewhere.path());
    expect_whole(keeps(counted, elsewhere.path() / "copy"));
    calls = counted.count();
  }
  for (std::size_t at = 0; at < calls; ++at) {
    const test::TemporaryFolder elsewhere;
    const fs::path where = elsewhere.path() / "copy";
    fs::copy(copy, where, fs::copy_options::recursive);
    test::FaultFileSystem killed(elsewhere.path());
    killed.kill_at(at);
    EXPECT_THROW(keeps(killed, where), test::Killed) << at;
    killed.heal();
    SCOPED_TRACE(at);
    expect_whole(keeps(killed, where));
  }
  for (std::size_t room = 1; room < 6; ++room) {
    const test::TemporaryFolder elsewhere;
    const fs::path where = elsewhere.path() / "copy";
    fs::copy(copy, where, fs::copy_options::recursive);
    test::FaultFileSystem full(elsewhere.path());
    full.fail("write", ENOSPC, room);
    SCOPED_TRACE(room);
    // It is said for as long as it is so.
    for (int i = 0; i < 2; ++i) {
      full.fail("write", ENOSPC, i == 0 ? room : 1);
      const Followed followed = keeps(full, where);
      EXPECT_EQ(followed.what, Following::kTwoHistories);
      if (!followed.not_kept.empty()) {
        EXPECT_THAT(followed.not_kept, HasSubstr("No space left on device"));
      }
      EXPECT_EQ(followed.not_kept.empty(),
                !fs::exists(followed.evidence / ".beginning") && fs::exists(followed.evidence / "tile"));
    }
    full.heal();
    expect_whole(keeps(full, where));
  }
}

TEST_F(FollowingTest, ACheckpointThatIsKeptLosesNothing) {
  follow(log, 300);
  LogToShow shown = PublishedLog(key, 100).at(600);
  const std::string alone = shown.note;
  shown.note += "\xE2\x80\x94 witness.example/w1 AAAAAAAA\n";
  const std::string cosigned = shown.note;
  const Followed first = follow(*tiles_of(shown));
  EXPECT_EQ(text_in(first.evidence / "checkpoint"), cosigned);
  shown.note = alone;
  EXPECT_EQ(follow(*tiles_of(shown)).evidence, first.evidence);
  EXPECT_EQ(text_in(first.evidence / "checkpoint"), cosigned);
  // What is kept whole needs no room.
  test::FaultFileSystem full(folder.path());
  full.fail("write", ENOSPC);
  const Followed again = follow_log(*tiles_of(shown), full, copy, {device});
  EXPECT_EQ(again.what, Following::kTwoHistories);
  EXPECT_EQ(again.evidence, first.evidence);
  EXPECT_EQ(again.not_kept, "");
  EXPECT_EQ(text_in(first.evidence / "checkpoint"), cosigned);
}

TEST_F(FollowingTest, LaterCosignaturesOfAnotherHistoryAreAdded) {
  follow(log, 300);
  const auto cosigned = [](LogToShow shown, const std::vector<std::string>& lines) {
    for (const std::string& line : lines) shown.note += "\xE2\x80\x94 " + line + "\n";
    return shown;
  };
  const std::string first_line = "witness.example/w1 AAAAAAAA", second_line = "witness.example/w2 AAAAAQAA",
                    made_up = "witness.example/w1 AAAAAAEB";
  const LogToShow shown = PublishedLog(key, 100).at(600);
  const Followed first = follow(*tiles_of(cosigned(shown, {first_line})));
  const fs::path kept = first.evidence / "checkpoint";
  EXPECT_EQ(first.not_kept, "");
  const Followed second = follow(*tiles_of(cosigned(shown, {second_line})));
  EXPECT_EQ(second.not_kept, "");
  EXPECT_EQ(text_in(kept), cosigned(shown, {first_line, second_line}).note);
  // One of a key that has one already: which of them holds nobody asks here.
  const Followed third = follow(*tiles_of(cosigned(shown, {made_up})));
  EXPECT_EQ(third.what, Following::kTwoHistories);
  EXPECT_THAT(third.not_kept, HasSubstr("for which the one that is kept has others"));
  EXPECT_EQ(text_in(kept), cosigned(shown, {first_line, second_line}).note);
  // No number of lines makes it a note that nobody reads any more.
  std::vector<std::string> many;
  for (int i = 10; i < 110; ++i) many.push_back("w.example/" + std::to_string(i) + " AAAAAAAA");
  many.resize(98);
  EXPECT_EQ(follow(*tiles_of(cosigned(shown, many))).what, Following::kTwoHistories);
  EXPECT_EQ(crypto::parse_note(text_in(kept)).why, "");
  EXPECT_THAT(text_in(kept), HasSubstr(second_line));
  // A full disk is said, and nothing is lost.
  const Followed other = follow(*tiles_of(PublishedLog(key, 200).at(600)));
  const std::string before = text_in(other.evidence / "checkpoint");
  test::FaultFileSystem full(folder.path());
  full.fail("write", ENOSPC);
  const LogToShow again = cosigned(PublishedLog(key, 200).at(600), {first_line});
  const Followed told = follow_log(*tiles_of(again), full, copy, {device});
  EXPECT_EQ(told.what, Following::kTwoHistories);
  EXPECT_NE(told.not_kept, "");
  EXPECT_EQ(text_in(other.evidence / "checkpoint"), before);
}

TEST_F(FollowingTest, LaterCosignaturesOfTheSameEntriesAreAdded) {
  LogToShow shown = log.at(300);
  const std::string alone = shown.note;
  follow(*tiles_of(shown));
  shown.note += "\xE2\x80\x94 witness.example/w1 AAAAAAAA\n";
  EXPECT_EQ(follow(*tiles_of(shown)).what, Following::kSame);
  EXPECT_EQ(text_in(copy / "checkpoint"), shown.note);
  const std::string cosigned = shown.note;
  shown.note = alone;
  EXPECT_EQ(follow(*tiles_of(shown)).what, Following::kSame);
  EXPECT_EQ(text_in(copy / "checkpoint"), cosigned);
}

TEST_F(FollowingTest, LaterCosignaturesOfACheckpointWithoutItsTilesAreAdded) {
  follow(log, 300);
  const fs::path other = published(PublishedLog(key, 10), 600);
  fs::remove(other / "tile/0/001");
  const Followed first = follow_folder(other);
  ASSERT_EQ(first.what, Following::kCouldNotTell);
  const std::string cosigned = text_in(other / "checkpoint") + "\xE2\x80\x94 witness.example/w1 AAAAAAAA\n";
  put(other / "checkpoint", cosigned);
  EXPECT_EQ(follow_folder(other).evidence, first.evidence);
  EXPECT_EQ(text_in(first.evidence), cosigned);
}

TEST_F(FollowingTest, EvidenceThatWasCutOffIsNoWholeOneWhereItsTilesAreNotToBeHadAnyMore) {
  follow(log, 300);
  const fs::path other = published(PublishedLog(key, 100), 300);
  test::FaultFileSystem full(folder.path());
  full.fail("write copy/forked", ENOSPC, 2);
  EXPECT_THAT(follow_log(*tiles_in_folder(other), full, copy, {device}).not_kept,
              HasSubstr("of its hashes not all are kept"));
  fs::remove_all(other / "tile");
  const Followed followed = follow_folder(other);
  EXPECT_EQ(followed.what, Following::kTwoHistories);
  EXPECT_TRUE(fs::exists(followed.evidence / ".beginning"));
  EXPECT_EQ(followed.not_kept, "of its hashes not all are kept, and they were not to be had this time");
}

TEST_F(FollowingTest, OfACheckpointAloneASecondHistoryOfTheSameLengthIsTold) {
  follow(log, 300);
  const fs::path other = published(PublishedLog(key, 10), 300);
  fs::remove_all(other / "tile");
  const Followed followed = follow_folder(other);
  EXPECT_EQ(followed.what, Following::kTwoHistories);
  EXPECT_FALSE(followed.common);
  EXPECT_TRUE(fs::exists(followed.evidence / "checkpoint"));
}

TEST_F(FollowingTest, WithoutItsTilesALongerOneTellsNothing) {
  follow(log, 300);
  const fs::path other = published(PublishedLog(key, 10), 600);
  fs::remove(other / "tile/0/001");
  const Followed followed = follow_folder(other);
  EXPECT_EQ(followed.what, Following::kCouldNotTell);
  EXPECT_THAT(followed.why, HasSubstr("the tile tile/0/001 is not there"));
  EXPECT_EQ(follow(log, 301).what, Following::kGoesOn);
  // Its checkpoint was signed, and is compared once there is something to compare with.
  EXPECT_EQ(follow(log, 599).what, Following::kGoesOn);
  const Followed later = follow(log, 601);
  EXPECT_EQ(later.what, Following::kTwoHistories);
  EXPECT_EQ(later.shown->size, 600U);
  EXPECT_EQ(later.kept->size, 601U);
  EXPECT_EQ(text_in(later.evidence / "checkpoint"), text_in(other / "checkpoint"));
  EXPECT_EQ(follow(log, 602).earlier_forks, std::vector<fs::path>{later.evidence});
}

TEST_F(FollowingTest, OfCheckpointsWithoutTilesSomeAreKeptAndNoMore) {
  follow(log, 300);
  for (std::uint64_t size = 400; size < 430; ++size) {
    const fs::path other = published(PublishedLog(key, 10), size);
    fs::remove_all(other / "tile");
    const Followed followed = follow_folder(other);
    EXPECT_EQ(followed.what, Following::kCouldNotTell);
    EXPECT_EQ(followed.evidence.empty(), size >= 416) << size;
    EXPECT_EQ(followed.why.find("its checkpoint is not kept") != std::string::npos, size >= 416) << size;
    if (size > 400) continue;
    EXPECT_EQ(follow_folder(other).evidence, followed.evidence) << "shown once more";
  }
  const auto names = archive::real_file_system().names_in(copy);
  EXPECT_EQ(
      std::ranges::count_if(names, [](const std::string& name) { return name.starts_with("unplaced-"); }),
      16);
}

/// Gives out one wrong tile, once.
class WrongOnce final : public TileSource {
 public:
  explicit WrongOnce(const TileSource& source) : source_(source) {}
  [[nodiscard]] std::optional<Bytes> read(const std::string& path, std::size_t most) const override {
    std::optional<Bytes> bytes = source_.read(path, most);
    if (bytes && path.starts_with("tile/0/002") && !std::exchange(was_wrong_, true))
      bytes->back() ^= std::byte{1};
    return bytes;
  }

 private:
  const TileSource& source_;
  mutable bool was_wrong_ = false;
};

TEST_F(FollowingTest, ATileThatIsWrongOnceAccusesNobody) {
  follow(log, 300);
  const LogToShow shown = log.at(600);
  const auto tiles = tiles_of(shown);
  const WrongOnce source(*tiles);
  const Followed followed = follow(source);
  EXPECT_EQ(followed.what, Following::kCouldNotTell);
  EXPECT_THAT(followed.why, HasSubstr("its tiles changed while they were read"));
  const Followed later = follow(source);
  EXPECT_EQ(later.what, Following::kGoesOn);
  EXPECT_TRUE(later.earlier_forks.empty());
}

TEST_F(FollowingTest, ANewKeyOfTheSameNameAccusesNobody) {
  const crypto::SigningKey new_key = crypto::SigningKey::generate();
  const std::vector<crypto::VerifierKey> both = {device, {"or-1", new_key.public_key()}};
  follow(log, 300);
  const LogToShow shown = PublishedLog(new_key, 0).at(400);
  const Followed followed = follow_log(*tiles_of(shown), archive::real_file_system(), copy, both);
  EXPECT_EQ(followed.what, Following::kCouldNotTell);
  EXPECT_THAT(followed.why, HasSubstr("by another key of the same name"));
}

TEST_F(FollowingTest, WhoeverPublishesKeepsNoOtherHistoryThere) {
  follow(log, 300);
  const LogToShow other = PublishedLog(key, 10).at(400);
  const Followed followed =
      follow_log(*tiles_of(other), archive::real_file_system(), copy, {device}, KeepEvidence::kNo);
  EXPECT_EQ(followed.what, Following::kTwoHistories);
  EXPECT_TRUE(followed.evidence.empty());
  for (const std::string& name : archive::real_file_system().names_in(copy))
    EXPECT_FALSE(name.starts_with("forked-")) << name;
}

TEST_F(FollowingTest, ChangedTilesAccuseNobody) {
  follow(log, 300);
  const fs::path source = published(log, 600);
  std::string tile = text_in(source / "tile/0/001");
  tile[8191] = static_cast<char>(tile[8191] ^ 1);
  put(source / "tile/0/001", tile);
  const Followed followed = follow_folder(source);
  EXPECT_EQ(followed.what, Following::kCouldNotTell);
  EXPECT_THAT(followed.why, HasSubstr("its tiles are not those of its checkpoint"));
  EXPECT_TRUE(fs::exists(followed.evidence));
  EXPECT_EQ(follow(log, 600).what, Following::kGoesOn);
  EXPECT_FALSE(fs::exists(followed.evidence)) << "it is of the same history";
}

TEST_F(FollowingTest, TilesOfAnotherLengthAreNone) {
  for (const std::size_t bytes : {0U, 1U, 8191U, 8193U, 9000U}) {
    const fs::path source = published(log, 600);
    put(source / "tile/0/001", std::string(bytes, 'a'));
    const Followed followed = follow_folder(source);
    EXPECT_EQ(followed.what, Following::kCouldNotTell) << bytes;
    EXPECT_THAT(followed.why, HasSubstr("tile/0/001")) << bytes;
  }
}

TEST_F(FollowingTest, AFullTileStandsForItsBeginning) {
  const fs::path source = published(log, 300);
  const fs::path later = published(log, 600);
  // A reader has the checkpoint of before, and the server has moved on.
  fs::remove_all(source / "tile");
  fs::copy(later / "tile", source / "tile", fs::copy_options::recursive);
  EXPECT_EQ(follow_folder(source).what, Following::kBegun);
}

TEST_F(FollowingTest, BelievesTheDevicesKeyAlone) {
  const crypto::SigningKey stranger = crypto::SigningKey::generate();
  Followed followed = follow(PublishedLog(stranger), 300);
  EXPECT_EQ(followed.what, Following::kCouldNotTell);
  EXPECT_THAT(followed.why, HasSubstr("not signed for the log of the device that was named"));
  EXPECT_FALSE(fs::exists(copy / "checkpoint"));

  follow(log, 300);
  followed = follow(PublishedLog(stranger, 10), 400);
  EXPECT_EQ(followed.what, Following::kCouldNotTell);

  // Of another log of the same device, a case's ledger, say.
  LogToShow other = log.at(300);
  other.checkpoint.origin = "kiroku/or-1/20260805T091502Z-3f9c21ab";
  other.note = crypto::sign_note(other.checkpoint.to_text(), "or-1", key);
  EXPECT_EQ(follow(*tiles_of(other)).what, Following::kCouldNotTell);
}

TEST_F(FollowingTest, WhereHardwareWasSilentNobodyIsAccused) {
  const auto hardware = std::make_shared<test::SoftwareHardwareKey>();
  const crypto::SigningKey both =
      crypto::SigningKey::from_pem(key.to_pem(nullptr).text(), nullptr).with_hardware(hardware);
  const std::vector<crypto::VerifierKey> devices = {crypto::verifier_key_of("or-1", both)};
  const auto follow_it = [&](const PublishedLog& shown, std::uint64_t size) {
    const LogToShow made = shown.at(size);
    return follow_log(*tiles_of(made), archive::real_file_system(), copy, devices);
  };
  EXPECT_EQ(follow_it(PublishedLog(both), 300).what, Following::kBegun);
  // The key in hardware cannot be copied; the other one can.
  hardware->fall_silent();
  const Followed followed = follow_it(PublishedLog(both, 10), 300);
  EXPECT_EQ(followed.what, Following::kCouldNotTell);
  EXPECT_THAT(followed.why, HasSubstr("lacks the signature by a key that the device has beside Ed25519"));
  EXPECT_TRUE(fs::exists(followed.evidence / "checkpoint"));
  const Followed without = follow_it(PublishedLog(both), 301);
  EXPECT_EQ(without.what, Following::kGoesOn) << "the log goes on without it";
  EXPECT_TRUE(without.lacks_signature);
  hardware->fall_silent(false);
  EXPECT_EQ(follow_it(PublishedLog(both, 10), 302).what, Following::kCouldNotTell)
      << "the copy's own checkpoint lacks it now";
  EXPECT_EQ(follow_it(PublishedLog(both), 302).what, Following::kGoesOn);
  // Whoever copied the other key can sign what claims to be from before the hardware.
  const std::vector<crypto::VerifierKey> since_200 = {
      device.with_hardware(*crypto::verifier_key_of("or-1", both).hardware(), 200)};
  const LogToShow from_before = PublishedLog(key, 10).at(100);
  EXPECT_EQ(follow_log(*tiles_of(from_before), archive::real_file_system(), copy, since_200).what,
            Following::kCouldNotTell);
  EXPECT_EQ(follow_it(PublishedLog(both, 10), 303).what, Following::kTwoHistories);
}

TEST_F(FollowingTest, ACopyThatWasChangedAccusesNobody) {
  follow(log, 300);
  std::string tile = text_in(copy / "tile/0/000");
  tile[0] = static_cast<char>(tile[0] ^ 1);
  put(copy / "tile/0/000", tile);
  Followed followed = follow(log, 400);
  EXPECT_EQ(followed.what, Following::kCouldNotTell);
  EXPECT_THAT(followed.why, HasSubstr("the copy does not hold"));

  fs::remove_all(copy / "tile");
  EXPECT_THAT(follow(log, 400).why, HasSubstr("the copy does not hold: the tile tile/0/000 is not there"));
  put(copy / "checkpoint", "nothing");
  EXPECT_THAT(follow(log, 400).why, HasSubstr("the copy does not hold: the file 'checkpoint' is no signed"));

  // Else whatever is shown then would be where everything begins.
  const fs::path other = published(log, 300);
  fs::remove(other / "checkpoint");
  const LogToShow shown = PublishedLog(key, 10).at(300);
  EXPECT_THAT(follow_log(*tiles_of(shown), archive::real_file_system(), other, {device}).why,
              HasSubstr("its checkpoint was taken away"));
}

TEST_F(FollowingTest, ACopyWhoseCheckpointSomebodyElseSignedAccusesNobody) {
  const crypto::SigningKey stranger = crypto::SigningKey::generate();
  const LogToShow forged = PublishedLog(stranger, 10).at(300);
  follow_log(*tiles_of(forged), archive::real_file_system(), copy, {{"or-1", stranger.public_key()}});
  const Followed followed = follow(log, 400);
  EXPECT_EQ(followed.what, Following::kCouldNotTell);
  EXPECT_THAT(followed.why, HasSubstr("the copy's own checkpoint is not signed by the device"));
}

TEST_F(FollowingTest, ALogOfTooManyEntriesIsNotRead) {
  LogToShow huge = log.at(10);
  huge.checkpoint.size = kMostPublishedEntries + 1;
  huge.note = crypto::sign_note(huge.checkpoint.to_text(), "or-1", key);
  const fs::path source = folder.path() / "huge";
  fs::create_directory(source);
  put(source / "checkpoint", huge.note);
  const Followed followed = follow_folder(source);
  EXPECT_EQ(followed.what, Following::kCouldNotTell);
  EXPECT_THAT(followed.why, HasSubstr("16777217 entries"));
}

TEST_F(FollowingTest, ALinkInAPublishedLogIsNotFollowed) {
  const fs::path source = published(log, 300);
  fs::rename(source / "tile/0/000", folder.path() / "elsewhere");
  fs::create_symlink(folder.path() / "elsewhere", source / "tile/0/000");
  EXPECT_EQ(follow_folder(source).what, Following::kCouldNotTell);
}

TEST_F(FollowingTest, IsReadOverHttpAndNoFurther) {
  const fs::path source = published(log, 600);
  std::vector<std::string> asked;
  http::ServerOptions options;
  options.listen = {"127.0.0.1", 0};
  options.answer = [&](const http::Request& request) {
    asked.push_back(request.target);
    const fs::path file = source / request.target.substr(sizeof("/or-1/") - 1);
    if (request.target == "/or-1/tile/0/002.p/88" && moved_)
      return http::Response{302, {{"Location", "/x"}}, {}};
    if (!fs::is_regular_file(file)) return http::Response{404, {}, {}};
    return http::Response{200, {}, text_in(file)};
  };
  options.refuse = [](const http::Refusal& refusal) { return http::Response{refusal.status, {}, {}}; };
  const http::Server server(std::move(options));
  const std::string address = "http://127.0.0.1:" + std::to_string(server.port());

  moved_ = true;
  Followed followed = follow(*tiles_over_http(address + "/or-1"));
  EXPECT_EQ(followed.what, Following::kCouldNotTell);
  EXPECT_THAT(followed.why, HasSubstr("/or-1/tile/0/002.p/88 answered 302"));
  moved_ = false;
  EXPECT_EQ(follow(*tiles_over_http(address + "/or-1")).what, Following::kBegun);
  asked.clear();
  EXPECT_EQ(follow(*tiles_over_http(address + "/or-1/")).what, Following::kSame);
  EXPECT_THAT(asked, testing::ElementsAre("/or-1/checkpoint")) << "what is known is not fetched again";

  put(source / "checkpoint", std::string(5U << 20U, 'a'));
  EXPECT_THAT(follow(*tiles_over_http(address + "/or-1")).why, HasSubstr("answered with more than"));
  EXPECT_THAT(follow(*tiles_over_http(address + "/elsewhere")).why, HasSubstr("no log is published there"));
  EXPECT_THAT(follow(*tiles_over_http("http://127.0.0.1:1/or-1")).why, HasSubstr("did not answer"));
}

TEST_F(FollowingTest, AFolderWithOtherThingsIsRefused) {
  fs::create_directory(copy);
  put(copy / "diary.txt", "mine");
  EXPECT_THROW(follow(log, 300), UsageError);
  EXPECT_EQ(archive::real_file_system().names_in(copy), std::vector<std::string>{"diary.txt"});
}

TEST_F(FollowingTest, TwoAtOnceInOneCopyAreRefused) {
  follow(log, 300);
  auto& files = archive::real_file_system();
  const auto other = files.append_to(copy / ".following");
  ASSERT_TRUE(other->try_lock());
  EXPECT_THROW(follow(log, 301), UsageError);
}

}  // namespace
}  // namespace kiroku::witness
