#include "archive/search/note_writer.h"

#include <cerrno>
#include <fstream>
#include <sys/stat.h>
#include <thread>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/fault_file_system.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::search {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

const std::string kRecorded = "20260805T091502Z-3f9c21ab", kNextCase = "20260806T091502Z-00000001";
const SearchWords kOne{"12345", "", "", ""}, kAnother{"777", "", "", ""};

class NoteWriterTest : public testing::Test {
 protected:
  NoteWriterTest() {
    std::ofstream(key_file_, std::ios::binary) << site_.key_for("or-1").text().text();
    EXPECT_EQ(::chmod(key_file_.c_str(), 0600), 0);
  }
  [[nodiscard]] std::optional<SearchNote> note(const std::string& case_id) const {
    std::ifstream in(note_file(folder_ / "search", case_id), std::ios::binary);
    return SearchNote::parse(std::string{std::istreambuf_iterator<char>(in), {}});
  }
  NoteReader::Answer ask(const std::string& case_id, const SearchWords& asked) {
    const std::optional<SearchNote> there = note(case_id);
    return there ? reader_.read("or-1", case_id, *there, asked) : NoteReader::Answer::kForeign;
  }

  const test::TemporaryFolder folder_;
  const std::filesystem::path key_file_ = folder_ / "search.key";
  const SiteKey site_ = SiteKey::make();
  NoteReader reader_{site_.clone()};
  test::FaultFileSystem files_{folder_.path()};
  NoteWriter writer_{key_file_, folder_ / "search", files_};
};

TEST_F(NoteWriterTest, TheNewestSubjectCounts) {
  writer_.write(kRecorded, kOne);
  EXPECT_EQ(ask(kRecorded, kOne), NoteReader::Answer::kFits);
  writer_.write(kRecorded, kAnother);
  EXPECT_EQ(ask(kRecorded, kOne), NoteReader::Answer::kDiffers);
  EXPECT_EQ(ask(kRecorded, kAnother), NoteReader::Answer::kFits);
}

TEST_F(NoteWriterTest, ACaseThatGoesOnTakesTheOthersWords) {
  writer_.carry_over(kNextCase, kRecorded);
  EXPECT_FALSE(note(kNextCase)) << "there were none";
  writer_.write(kRecorded, kOne);
  writer_.carry_over(kNextCase, kRecorded);
  EXPECT_EQ(ask(kNextCase, kOne), NoteReader::Answer::kFits);
  // Whom it is about may be known later.
  writer_.write(kNextCase, kAnother);
  EXPECT_EQ(ask(kNextCase, kAnother), NoteReader::Answer::kFits);
  EXPECT_EQ(ask(kRecorded, kOne), NoteReader::Answer::kFits);
}

TEST_F(NoteWriterTest, AStolenApplianceTellsNothingOfTheCasesBefore) {
  writer_.write(kRecorded, kOne);
  // What is there now, tried on all that it wrote.
  const ApplianceKey stolen = ApplianceKey::read(key_file_);
  const std::optional<SearchNote> before = note(kRecorded);
  ASSERT_TRUE(before);
  ApplianceKey tried{stolen.appliance, stolen.series, before->of.step, {stolen.now.chain.clone()}};
  for (int steps = 0; steps < 100; ++steps) {
    EXPECT_NE(make_note(tried, kRecorded, kOne).hashes.substr(0, 32), before->hashes.substr(0, 32));
    tried.now = tried.now.next();
  }
}

TEST_F(NoteWriterTest, ADiskThatFailsCostsTheNoteAlone) {
  files_.fail("write", ENOSPC);
  EXPECT_THROW(writer_.write(kRecorded, kOne), IoError);
  EXPECT_FALSE(note(kRecorded));
  files_.heal();
  writer_.write(kRecorded, kOne);
  EXPECT_EQ(ask(kRecorded, kOne), NoteReader::Answer::kFits);
}

TEST_F(NoteWriterTest, WithoutItsKeyThereIsNoNote) {
  std::filesystem::remove(key_file_);
  EXPECT_THAT([&] { writer_.write(kRecorded, kOne); },
              ThrowsMessage<Error>(HasSubstr("there is no search key")));
  EXPECT_FALSE(note(kRecorded));
}

TEST_F(NoteWriterTest, WhatIsNoNoteOfTheEarlierCaseIsNotCarriedOver) {
  writer_.write(kRecorded, kOne);
  for (const std::string& text : {std::string("{}"), std::string(2000, 'x'), note(kRecorded)->text()}) {
    std::ofstream(note_file(folder_ / "search", kNextCase), std::ios::binary) << text;
    EXPECT_THROW(writer_.carry_over("20260807T091502Z-00000002", kNextCase), Error);
  }
  EXPECT_FALSE(note("20260807T091502Z-00000002"));
}

TEST_F(NoteWriterTest, RoomsShareOneKey) {
  std::vector<std::thread> rooms;
  for (int room = 0; room < 4; ++room) {
    rooms.emplace_back([&, room] {
      for (int i = 0; i < 8; ++i)
        writer_.write("2026080" + std::to_string(room + 1) + "T09150" + std::to_string(i) + "Z-3f9c21ab",
                      kOne);
    });
  }
  for (std::thread& room : rooms) room.join();
  EXPECT_EQ(ApplianceKey::read(key_file_).step, 32U);
  for (int room = 0; room < 4; ++room) {
    for (int i = 0; i < 8; ++i)
      EXPECT_EQ(ask("2026080" + std::to_string(room + 1) + "T09150" + std::to_string(i) + "Z-3f9c21ab", kOne),
                NoteReader::Answer::kFits);
  }
}

TEST(NoteFile, HasTheNameOfItsCase) {
  EXPECT_EQ(note_file("a", kRecorded), "a/" + kRecorded + ".json");
  EXPECT_EQ(case_of_note(kRecorded + ".json"), kRecorded);
  for (const char* name : {"", ".json", "x.json", "20260805T091502Z-3f9c21ab",
                           "a/20260805T091502Z-3f9c21ab.json", "20260805T091502Z-3f9c21ab.json.part"})
    EXPECT_EQ(case_of_note(name), "") << name;
}

}  // namespace
}  // namespace kiroku::search
