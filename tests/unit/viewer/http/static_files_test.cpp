#include "viewer/http/static_files.h"

#include <filesystem>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/temporary_folder.h"

namespace kiroku::viewer {
namespace {

namespace fs = std::filesystem;

class Page : public testing::Test {
 protected:
  Page() {
    fs::create_directories(folder / "web/assets");
    write("web/index.html", "<!doctype html>");
    write("web/assets/index-3f9c21ab.js", "plain");
    write("web/assets/index-3f9c21ab.js.gz", "gzipped");
    write("web/assets/index-3f9c21ab.js.br", "brotli");
    write("web/orphan.css.gz", "gzipped");
    write("web/.hidden", "secret");
    write("secret.txt", "secret");
    fs::create_symlink(folder / "secret.txt", folder / "web/link.txt");
  }
  void write(const std::string& name, const std::string& text) const { std::ofstream(folder / name) << text; }
  static Response get(const StaticFiles& files, const std::string& target, const std::string& accepted = "") {
    Request request;
    request.method = "GET";
    request.target = target;
    if (!accepted.empty()) request.headers["accept-encoding"] = accepted;
    return files.respond(request);
  }
  static std::string body_of(const Response& response) {
    const auto* bytes = std::get_if<BytesBody>(&response.body);
    return bytes == nullptr ? "" : std::string(text_of(*bytes->bytes));
  }
  test::TemporaryFolder folder;
};

TEST_F(Page, IsServedWithItsTypesAndTags) {
  const StaticFiles files = StaticFiles::load(folder / "web");
  const Response index = get(files, "/");
  EXPECT_EQ(index.status, 200);
  EXPECT_EQ(index.type, "text/html; charset=utf-8");
  EXPECT_EQ(index.cache, "no-cache");
  EXPECT_EQ(body_of(index), "<!doctype html>");
  EXPECT_TRUE(index.entity_tag.starts_with('"') && index.entity_tag.ends_with('"'));
  const Response script = get(files, "/assets/index-3f9c21ab.js");
  EXPECT_EQ(script.type, "text/javascript; charset=utf-8");
  EXPECT_EQ(script.cache, "public, max-age=31536000, immutable");
  EXPECT_NE(script.entity_tag, index.entity_tag);
}

TEST_F(Page, SendsWhatIsCompressedToWhoAcceptsIt) {
  const StaticFiles files = StaticFiles::load(folder / "web");
  EXPECT_EQ(body_of(get(files, "/assets/index-3f9c21ab.js", "gzip, br")), "brotli");
  EXPECT_EQ(body_of(get(files, "/assets/index-3f9c21ab.js", "gzip")), "gzipped");
  EXPECT_EQ(body_of(get(files, "/assets/index-3f9c21ab.js", "br;q=0")), "plain");
  EXPECT_NE(get(files, "/assets/index-3f9c21ab.js", "br").entity_tag,
            get(files, "/assets/index-3f9c21ab.js").entity_tag);
}

TEST_F(Page, OfAnAddressWithoutExtensionIsTheIndex) {
  const StaticFiles files = StaticFiles::load(folder / "web");
  EXPECT_EQ(body_of(get(files, "/cases")), "<!doctype html>");
  EXPECT_EQ(get(files, "/absent.js").status, 404);
}

TEST_F(Page, ShowsNothingOutsideItsFolder) {
  const StaticFiles files = StaticFiles::load(folder / "web");
  for (const char* target : {"/link.txt", "/.hidden", "/orphan.css", "/orphan.css.gz", "/secret.txt",
                             "/assets/index-3f9c21ab.js.gz"}) {
    EXPECT_EQ(get(files, target).status, 404) << target;
  }
}

TEST_F(Page, IsRefusedWithoutAnIndexAndAbsentWithoutAFolder) {
  EXPECT_THROW(StaticFiles::load(folder / "web/assets"), UsageError);
  EXPECT_THROW(StaticFiles::load(folder / "nowhere"), UsageError);
  EXPECT_EQ(get(StaticFiles(), "/").status, 404);
}

}  // namespace
}  // namespace kiroku::viewer
