#include "fleet/object_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "tests/support/scripted_server.h"

namespace kiroku::fleet {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::Property;
using testing::ThrowsMessage;

StoreCredentials keys() { return {"or-1-key", crypto::Secret::copy_of("not to be told")}; }

ObjectStore store_at(const std::string& endpoint) {
  return ObjectStore({endpoint, "recordings", "us-east-1", {}}, keys());
}

std::string endpoint_of(const test::ScriptedServer& server) {
  return "http://127.0.0.1:" + std::to_string(server.port());
}

std::string refusal(const std::string& status, const std::string& code) {
  return test::http_answer(status, "application/xml",
                           "<?xml version=\"1.0\"?><Error><Code>" + code + "</Code></Error>");
}

std::string head_answer(const std::string& headers) {
  return "HTTP/1.1 200 OK\r\nConnection: close\r\n" + headers + "\r\n";
}

/// What require_lockable() says of such an answer.
std::string said_of(const std::string& answer) {
  const test::ScriptedServer server(answer);
  ObjectStore store = store_at(endpoint_of(server));
  try {
    store.require_lockable();
  } catch (const StoreError& error) {
    return error.what();
  }
  return "";
}

TEST(ObjectStore, RefusesAddressesThatAreNone) {
  for (const char* endpoint : {"store.example", "ftp://store.example", "https://",
                               "https://store.example/path", "https://a@b", "http://a b"})
    EXPECT_THROW(store_at(endpoint), UsageError) << endpoint;
  EXPECT_THROW(ObjectStore({"https://store.example", "Recordings", "us-east-1", {}}, keys()), UsageError);
  EXPECT_THROW(ObjectStore({"https://store.example", "re", "us-east-1", {}}, keys()), UsageError);
  EXPECT_THROW(ObjectStore({"https://store.example", "recordings", "", {}}, keys()), UsageError);
  EXPECT_NO_THROW(ObjectStore({"https://store.example:7480", "recordings", "eu-1", {}}, keys()));
}

TEST(ObjectStore, KeysAreThoseThatEveryStoreTakes) {
  EXPECT_TRUE(is_plain_key("or-1/20261126T091502Z-3f9c21ab/segments/endoscope/00000000.ts.age"));
  for (const char* key : {"", "/a", "a b", "a+b", "a?b", "a%20b", "\xc3\xa9", "a\nb"})
    EXPECT_FALSE(is_plain_key(key)) << key;
}

TEST(ObjectStore, GetsTheBytesOfARangeAndNothingElse) {
  test::ScriptedServer server(test::http_answer("206 Partial Content", "application/octet-stream", "range"));
  ObjectStore store = store_at(endpoint_of(server));
  EXPECT_EQ(store.get_range("or-1/a", "v1", 4096, 5), to_bytes("range"));
  EXPECT_THAT(server.last_request(), AllOf(HasSubstr("GET /recordings/or-1/a?versionId=v1 "),
                                           HasSubstr("Range: bytes=4096-4100\r\n")));
  // Others would take the beginning of an object for a part of its middle.
  const auto get = [&] { (void)store.get_range("or-1/a", "v1", 4096, 5); };
  server.answer_with(test::http_answer("200 OK", "application/octet-stream", "whole"));
  EXPECT_THAT(get, ThrowsMessage<Error>(HasSubstr("it must send ranges")));
  server.answer_with(test::http_answer("206 Partial Content", "application/octet-stream", "longer"));
  EXPECT_THAT(get, ThrowsMessage<Error>(HasSubstr("sent 6 bytes with status 206 where 5 from byte 4096")));
  server.answer_with(refusal("404 Not Found", "NoSuchKey"));
  EXPECT_THROW(get(), StoreError);
}

TEST(ObjectStore, SignsAndNeverTellsTheSecret) {
  const test::ScriptedServer server(test::http_answer(
      "200 OK", "application/xml", "<C><ObjectLockEnabled>Enabled</ObjectLockEnabled></C>"));
  ObjectStore store = store_at(endpoint_of(server));
  store.require_lockable();
  EXPECT_THAT(
      server.last_request(),
      AllOf(
          HasSubstr("GET /recordings?object-lock="),
          HasSubstr("Authorization: AWS4-HMAC-SHA256 Credential=or-1-key/"),
          HasSubstr("x-amz-content-sha256: e3b0c44298fc1c149afbf4c8996fb92427ae41e4649b934ca495991b7852b855"),
          Not(HasSubstr("not to be told"))));
}

TEST(ObjectStore, SaysWhatARefusalMeans) {
  EXPECT_THAT(said_of(refusal("404 Not Found", "NoSuchBucket")), HasSubstr("there is no such bucket"));
  EXPECT_THAT(said_of(refusal("404 Not Found", "ObjectLockConfigurationNotFoundError")),
              HasSubstr("has no Object Lock"));
  EXPECT_THAT(said_of(test::http_answer("200 OK", "application/xml", "<ObjectLockConfiguration/>")),
              HasSubstr("has no Object Lock"));
  EXPECT_THAT(said_of(refusal("403 Forbidden", "InvalidAccessKeyId")),
              HasSubstr("does not know the access key 'or-1-key'"));
  EXPECT_THAT(said_of(refusal("403 Forbidden", "SignatureDoesNotMatch")),
              HasSubstr("the secret key is not the one of"));
  EXPECT_THAT(said_of(refusal("403 Forbidden", "RequestTimeTooSkewed")), HasSubstr("set the clock"));
  EXPECT_THAT(said_of(refusal("400 Bad Request", "ExpiredToken")), HasSubstr("has expired or was suspended"));
  EXPECT_THAT(said_of(refusal("403 Forbidden", "AccessDenied")), HasSubstr("has no right to do this"));
  EXPECT_THAT(said_of(refusal("301 Moved", "PermanentRedirect")),
              HasSubstr("in another region than 'us-east-1'"));
  EXPECT_THAT(said_of(refusal("418 Teapot", "Brew\x1b[2J")),
              AllOf(HasSubstr("status 418"), Not(HasSubstr("\x1b"))));
  EXPECT_THAT(said_of(test::http_answer("500 Oops", "text/html", "<html>")), HasSubstr("status 500"));
}

/// How long the store asks to be left alone, by an answer of 503 with these lines in its header.
std::chrono::seconds asked_wait(const std::string& lines) {
  const test::ScriptedServer server("HTTP/1.1 503 Slow Down\r\nContent-Length: 0\r\nConnection: close\r\n" +
                                    lines + "\r\n");
  ObjectStore store = store_at(endpoint_of(server));
  try {
    store.require_lockable();
  } catch (const StoreError& error) {
    return error.wait();
  }
  return std::chrono::seconds(-1);
}

TEST(ObjectStore, TellsHowLongTheStoreWantsToBeLeftAlone) {
  EXPECT_EQ(asked_wait(""), std::chrono::seconds(0));
  EXPECT_EQ(asked_wait("Retry-After: 120\r\n"), std::chrono::seconds(120));
  EXPECT_EQ(asked_wait("Retry-After: Fri, 31 Dec 1999 23:59:59 GMT\r\n"), std::chrono::seconds(0));
  EXPECT_EQ(asked_wait("Retry-After: Fri, 31 Dec 2100 23:59:59 GMT\r\n"), StoreError::kLongestAskedWait);
  EXPECT_EQ(asked_wait("Retry-After: 86400\r\n"), StoreError::kLongestAskedWait);
  EXPECT_EQ(asked_wait("Retry-After: soon\r\n"), std::chrono::seconds(0));
}

// What is missing from a header that was cut off is not what the store did not say: an object would be put
// once more.
TEST(ObjectStore, AnAnswerThatWasCutOffIsNone) {
  const test::ScriptedServer server(
      "HTTP/1.1 200 OK\r\nContent-Length: 7\r\nx-amz-version-id: v1\r\nx-amz-me");
  ObjectStore store = store_at(endpoint_of(server));
  try {
    (void)store.look("or-1/a");
    FAIL();
  } catch (const StoreError& error) {
    EXPECT_TRUE(error.passes());
    EXPECT_THAT(error.what(), HasSubstr("its answer was cut off"));
  }
}

TEST(ObjectStore, KnowsWhatMayPass) {
  const auto passes = [](long status, const char* code) { return StoreError("", status, code).passes(); };
  EXPECT_TRUE(passes(0, ""));
  EXPECT_TRUE(passes(503, "SlowDown"));
  EXPECT_TRUE(passes(429, ""));
  EXPECT_TRUE(passes(400, "RequestTimeout"));
  EXPECT_FALSE(passes(403, "AccessDenied"));
  EXPECT_FALSE(passes(404, "NoSuchBucket"));
}

TEST(ObjectStore, KnowsWhatIsOfOneObject) {
  const auto is_of_one = [](long status, const char* code) {
    return StoreError("", status, code).is_of_one_object();
  };
  EXPECT_TRUE(is_of_one(400, "XAmzContentSHA256Mismatch"));
  EXPECT_TRUE(is_of_one(400, "EntityTooLarge"));
  EXPECT_TRUE(is_of_one(413, ""));
  EXPECT_FALSE(is_of_one(400, "RequestTimeout"));
  EXPECT_FALSE(is_of_one(403, "AccessDenied"));
  EXPECT_FALSE(is_of_one(503, "SlowDown"));
  EXPECT_FALSE(is_of_one(0, ""));
}

TEST(ObjectStore, AStoreThatIsNotThereIsSaidToBe) {
  std::string url;
  {
    const test::ScriptedServer gone("");
    url = endpoint_of(gone);
  }
  ObjectStore store = store_at(url);
  EXPECT_THAT([&] { store.require_lockable(); }, ThrowsMessage<StoreError>(HasSubstr("does not answer")));
}

TEST(ObjectStore, ReadsWhatAVersionIs) {
  const test::ScriptedServer server(
      head_answer("Content-Length: 4711\r\nx-amz-version-id: v1\r\nX-Amz-Meta-Kiroku-Sha256: abc\r\n"
                  "x-amz-object-lock-mode: COMPLIANCE\r\n"
                  "x-amz-object-lock-retain-until-date: 2036-11-23T15:00:00.123456789Z\r\n"));
  ObjectStore store = store_at(endpoint_of(server));
  const auto object = store.look("or-1/x", "v1");
  ASSERT_TRUE(object);
  EXPECT_THAT(server.last_request(), HasSubstr("HEAD /recordings/or-1/x?versionId=v1"));
  EXPECT_EQ(object->bytes, 4711U);
  EXPECT_EQ(object->version, "v1");
  EXPECT_EQ(object->sha256, "abc");
  EXPECT_TRUE(object->compliance);
  EXPECT_EQ(object->lock_ends, parse_utc("2036-11-23T15:00:00Z"));
}

TEST(ObjectStore, ALegalHoldIsAskedForAndTold) {
  test::ScriptedServer server(
      "HTTP/1.1 200 OK\r\nConnection: close\r\nContent-Length: 0\r\n"
      "x-amz-version-id: v1\r\n\r\n");
  ObjectStore store = store_at(endpoint_of(server));
  store.put("a", *crypto::memory_source({}), crypto::sha256({}), {.legal_hold = true});
  EXPECT_THAT(server.last_request(),
              AllOf(HasSubstr("x-amz-object-lock-legal-hold: ON"), Not(HasSubstr("x-amz-object-lock-mode"))));
  store.put("a", *crypto::memory_source({}), crypto::sha256({}), {});
  EXPECT_THAT(server.last_request(), Not(HasSubstr("x-amz-object-lock")));
  store.set_legal_hold("a", "v/1", true);
  EXPECT_THAT(server.last_request(), AllOf(HasSubstr("PUT /recordings/a?legal-hold=&versionId=v%2F1"),
                                           HasSubstr("x-amz-checksum-sha256: ")));
  server.answer_with(head_answer("Content-Length: 1\r\nx-amz-object-lock-legal-hold: ON\r\n"));
  EXPECT_TRUE(store.look("a")->legal_hold);
  server.answer_with(head_answer("Content-Length: 1\r\nx-amz-object-lock-legal-hold: OFF\r\n"));
  EXPECT_FALSE(store.look("a")->legal_hold);
  server.answer_with(refusal("403 Forbidden", "AccessDenied"));
  EXPECT_THAT([&] { store.set_legal_hold("a", "v1", false); },
              ThrowsMessage<StoreError>(HasSubstr("cannot lift the legal hold of a")));
}

TEST(ObjectStore, ALockIsSetAnewOnOneVersion) {
  test::ScriptedServer server("HTTP/1.1 200 OK\r\nConnection: close\r\nContent-Length: 0\r\n\r\n");
  ObjectStore store = store_at(endpoint_of(server));
  store.set_retention("a", "v/1", *parse_utc("2036-11-23T15:00:00Z"));
  EXPECT_THAT(server.last_request(), AllOf(HasSubstr("PUT /recordings/a?retention=&versionId=v%2F1"),
                                           HasSubstr("x-amz-checksum-sha256: ")));
  server.answer_with(refusal("403 Forbidden", "AccessDenied"));
  EXPECT_THAT([&] { store.set_retention("a", "v1", *parse_utc("2036-11-23T15:00:00Z")); },
              ThrowsMessage<StoreError>(HasSubstr("cannot lock a in")));
}

TEST(ObjectStore, HowFastItSendsIsAskedBeforeEachObject) {
  const test::ScriptedServer server(
      "HTTP/1.1 200 OK\r\nConnection: close\r\nContent-Length: 0\r\n"
      "x-amz-version-id: v1\r\n\r\n");
  int asked = 0;
  ObjectStore store({endpoint_of(server), "recordings", "us-east-1", {}}, keys(),
                    {.bytes_per_second = [&] { return std::uint64_t{++asked == 1 ? 20'000'000U : 0U}; }});
  for (int i = 1; i <= 2; ++i) {
    store.put("a", *crypto::memory_source({}), crypto::sha256({}), {});
    EXPECT_EQ(asked, i);
  }
}

std::string listing(const std::string& inside) {
  return test::http_answer("200 OK", "application/xml",
                           "<?xml version=\"1.0\"?><ListVersionsResult>" + inside + "</ListVersionsResult>");
}

TEST(ObjectStore, ListsEveryVersion) {
  test::ScriptedServer server(listing(
      "<IsTruncated>false</IsTruncated>"
      "<Version><Key>or-1/a</Key><VersionId>v2</VersionId><IsLatest>true</IsLatest><Size>2</Size></Version>"
      "<DeleteMarker><Key>or-1/b</Key><VersionId>v1</VersionId></DeleteMarker>"
      "<Version><Key>or-1/a</Key><VersionId>v1</VersionId><IsLatest>false</IsLatest><Size>1</Size></"
      "Version>"));
  ObjectStore store = store_at(endpoint_of(server));
  std::vector<std::string> found;
  const auto list = [&] {
    store.for_each_version("or-1/", [&](const ListedVersion& each) {
      found.push_back(each.key + " " + each.version + " " + std::to_string(each.bytes) +
                      (each.newest ? " newest" : ""));
    });
  };
  list();
  EXPECT_THAT(found, testing::ElementsAre("or-1/a v2 2 newest", "or-1/a v1 1"));
  EXPECT_THAT(server.last_request(), HasSubstr("GET /recordings?prefix=or-1%2F&versions="));
  const auto refused = [&](const std::string& inside, const std::string& sentence) {
    server.answer_with(listing(inside));
    EXPECT_THAT(list, ThrowsMessage<Error>(HasSubstr(sentence)));
  };
  refused("<IsTruncated>true</IsTruncated>", "does not say where");
  refused("<IsTruncated>true</IsTruncated><NextKeyMarker>or-1/a</NextKeyMarker>", "told before");
  refused("<Version><Key>or-2/a</Key><VersionId>v1</VersionId><Size>1</Size></Version>",
          "among what begins with or-1/");
  refused("<Version><Key>or-1/a</Key><Size>1</Size></Version>", "without key, version or size");
  refused("<Version><Key>or-1/a</Key><VersionId>v1</VersionId><Size>-1</Size></Version>",
          "without key, version or size");
  server.answer_with(test::http_answer("200 OK", "text/html", "<html>"));
  EXPECT_THAT(list, ThrowsMessage<Error>(HasSubstr("is none")));
}

TEST(ObjectStore, TellsWhenEachVersionWasPutAndWhatItsClockSays) {
  const auto version = [](const std::string& put) {
    return "<Version><Key>or-1/a</Key><VersionId>v1</VersionId><Size>1</Size>" + put + "</Version>";
  };
  test::ScriptedServer server(listing("<IsTruncated>false</IsTruncated>"));
  ObjectStore store = store_at(endpoint_of(server));
  EXPECT_FALSE(store.told_time());
  const auto put = [&](const std::string& said) {
    server.answer_with(listing("<IsTruncated>false</IsTruncated>" + version(said)));
    std::optional<UtcTime> time;
    store.for_each_version("or-1/", [&](const ListedVersion& each) { time = each.put; });
    return time;
  };
  EXPECT_EQ(put("<LastModified>2026-11-29T16:45:00.123456789Z</LastModified>"),
            parse_utc("2026-11-29T16:45:00Z"));
  EXPECT_FALSE(put(""));
  EXPECT_FALSE(put("<LastModified>yesterday</LastModified>"));
  EXPECT_FALSE(store.told_time()) << "an answer without Date";
  server.answer_with(head_answer("Content-Length: 1\r\nDate: Sun, 29 Nov 2026 16:45:00 GMT\r\n"));
  store.look("a");
  EXPECT_EQ(store.told_time(), parse_utc("2026-11-29T16:45:00Z"));
  EXPECT_FALSE(time_of_answer({{"date", "no time"}}));
}

TEST(ObjectStore, AListThatGoesBackIsRefused) {
  const auto page = [](const std::string& next) {
    return listing(
        "<IsTruncated>true</IsTruncated><NextKeyMarker>or-1/" + next +
        "</NextKeyMarker><Version><Key>or-1/a</Key><VersionId>v1</VersionId><Size>1</Size></Version>");
  };
  test::ScriptedServer server(page("b"));
  ObjectStore store = store_at(endpoint_of(server));
  int pages = 0;
  const auto list = [&] {
    store.for_each_version("or-1/", [&](const ListedVersion& /*each*/) {
      if (++pages == 10) throw std::runtime_error("it goes on");
      server.answer_with(page(pages % 2 == 0 ? "b" : "a"));
    });
  };
  EXPECT_THAT(list, ThrowsMessage<Error>(HasSubstr("told before")));
}

TEST(ObjectStore, AnotherVersionThanWasAskedForTellsNothing) {
  const test::ScriptedServer server(head_answer("Content-Length: 1\r\nx-amz-version-id: v2\r\n"));
  ObjectStore store = store_at(endpoint_of(server));
  EXPECT_EQ(store.look("a")->version, "v2");
  EXPECT_EQ(store.look("a", "v2")->version, "v2");
  EXPECT_THAT([&] { store.look("a", "v1"); }, ThrowsMessage<Error>(HasSubstr("tells of version v2")));
}

TEST(ObjectStore, AnotherModeIsNoLock) {
  test::ScriptedServer server(head_answer("Content-Length: 1\r\nx-amz-object-lock-mode: GOVERNANCE\r\n"));
  ObjectStore store = store_at(endpoint_of(server));
  EXPECT_FALSE(store.look("a")->compliance);
  EXPECT_EQ(store.look("a")->lock_ends, std::nullopt);
}

TEST(ObjectStore, WhatIsNotThereIsNothingAndWhatMakesNoSenseIsRefused) {
  test::ScriptedServer server("HTTP/1.1 404 Not Found\r\nConnection: close\r\n\r\n");
  ObjectStore store = store_at(endpoint_of(server));
  EXPECT_EQ(store.look("a"), std::nullopt);
  server.answer_with(head_answer("Content-Length: 1\r\nx-amz-object-lock-retain-until-date: never\r\n"));
  EXPECT_THAT([&] { store.look("a"); }, ThrowsMessage<Error>(HasSubstr("'never', which is no time")));
  server.answer_with("HTTP/1.1 403 Forbidden\r\nConnection: close\r\n\r\n");
  EXPECT_THAT([&] { store.look("a"); }, ThrowsMessage<StoreError>(HasSubstr("has no right")));
}

TEST(ObjectStore, TakesNoMoreThanItAskedFor) {
  test::ScriptedServer server(test::http_answer("200 OK", "binary", std::string(5000, 'x')));
  ObjectStore store = store_at(endpoint_of(server));
  EXPECT_EQ(store.get("a", "", 5000).size(), 5000U);
  EXPECT_THAT([&] { store.get("a", "", 4999); }, ThrowsMessage<Error>(HasSubstr("longer than 4999 bytes")));
  server.answer_with(test::http_answer("200 OK", "binary", std::string(2U << 20, 'x')));
  EXPECT_THAT([&] { store.get("a", "", 4999); }, ThrowsMessage<Error>(HasSubstr("is longer than")));
}

TEST(ObjectStore, PutsNothingUnderAKeyThatStoresReadDifferently) {
  ObjectStore store = store_at("http://127.0.0.1:9");
  EXPECT_THAT([&] { store.put("a b", *crypto::memory_source({}), crypto::sha256({}), {}); },
              ThrowsMessage<Error>(HasSubstr("'a b' cannot be the name of an object")));
}

}  // namespace
}  // namespace kiroku::fleet
