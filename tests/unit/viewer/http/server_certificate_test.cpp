#include "viewer/http/server_certificate.h"

#include <algorithm>
#include <atomic>
#include <filesystem>
#include <thread>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/temporary_folder.h"

namespace kiroku::viewer {
namespace {

namespace fs = std::filesystem;

TEST(OwnCertificate, IsMadeOnceByServersThatStartTogether) {
  const test::TemporaryFolder folder;
  constexpr int kServers = 8;
  std::atomic<int> makers = 0;
  std::vector<std::string> fingerprints(kServers);
  std::vector<std::thread> servers;
  for (int i = 0; i < kServers; ++i) {
    servers.emplace_back([&, i] {
      bool made = false;
      fingerprints.at(static_cast<std::size_t>(i)) =
          fingerprint(own_certificate(folder.path(), {"127.0.0.1"}, made).certificate_pem);
      makers += made ? 1 : 0;
    });
  }
  for (std::thread& each : servers) each.join();
  EXPECT_EQ(makers, 1);
  EXPECT_EQ(std::count(fingerprints.begin(), fingerprints.end(), fingerprints.front()), kServers);
  bool made = false;
  EXPECT_EQ(fingerprint(own_certificate(folder.path(), {"127.0.0.1"}, made).certificate_pem),
            fingerprints.front());
  EXPECT_FALSE(made);
}

TEST(OwnCertificate, IsMadeAnewWhereTheKeyIsOfAnother) {
  const test::TemporaryFolder folder, other;
  bool made = false;
  own_certificate(folder.path(), {"127.0.0.1"}, made);
  own_certificate(other.path(), {"127.0.0.1"}, made);
  fs::copy_file(other / "viewer.key", folder / "viewer.key", fs::copy_options::overwrite_existing);
  const ServerCertificate mended = own_certificate(folder.path(), {"127.0.0.1"}, made);
  EXPECT_TRUE(made);
  EXPECT_EQ(fingerprint(own_certificate(folder.path(), {"127.0.0.1"}, made).certificate_pem),
            fingerprint(mended.certificate_pem));
  EXPECT_FALSE(made);
}

}  // namespace
}  // namespace kiroku::viewer
