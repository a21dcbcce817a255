#include "http/http_head.h"

#include <string>

#include <gtest/gtest.h>

namespace kiroku {
namespace {

std::string post(const std::string& fields) {
  return "POST /x HTTP/1.1\r\nHost: kiroku\r\n" + fields + "\r\n";
}

TEST(HttpHead, IsTakenWhereItsBodyEndsInOneWayOnly) {
  for (const std::string& head :
       {post(""), post("Content-Length: 12\r\n"), post("content-length:0\r\n"),
        post("Transfer-Encoding: chunked\r\n"), post("transfer-encoding: Chunked \r\n"),
        post("Cookie: a=b\r\nCookie: c=d\r\n"), post("X-Note: a\tb \xC3\xA9\r\n"), post("X-Empty:\r\n"),
        std::string("GET /metrics HTTP/1.0\r\n\r\n"),
        std::string("POST / HTTP/1.0\r\nContent-Length: 3\r\n\r\n")}) {
    EXPECT_EQ(http_head_problem(head), "") << head;
  }
}

TEST(HttpHead, IsRefusedWhereABodyCouldBeReadAsAnotherRequest) {
  constexpr std::string_view kCoding = "the only Transfer-Encoding known here is chunked";
  for (const char* coding : {"gzip", "chunked, gzip", "gzip, chunked", "chunked, chunked", "identity",
                             "xchunked", "", "chunked;q=1", "\"chunked\""}) {
    EXPECT_EQ(http_head_problem(post("Transfer-Encoding: " + std::string(coding) + "\r\n")), kCoding)
        << coding;
  }
  EXPECT_EQ(http_head_problem(post("Transfer-Encoding: chunked\r\nTransfer-Encoding: chunked\r\n")),
            "the header Transfer-Encoding stands there twice");
  EXPECT_EQ(http_head_problem(post("Content-Length: 3\r\nTransfer-Encoding: chunked\r\n")),
            "Content-Length and Transfer-Encoding exclude each other");
  EXPECT_EQ(http_head_problem(post("Transfer-Encoding: chunked\r\nContent-Length: 3\r\n")),
            "Content-Length and Transfer-Encoding exclude each other");
  EXPECT_EQ(http_head_problem(post("Content-Length: 3\r\nContent-Length: 3\r\n")),
            "the header Content-Length stands there twice");
  for (const char* length : {"", "3, 3", "+3", "-3", "0x3", "3 3", "3.0", "9999999999999999999"}) {
    EXPECT_EQ(http_head_problem(post("Content-Length: " + std::string(length) + "\r\n")),
              "the header Content-Length is no number")
        << length;
  }
  EXPECT_EQ(http_head_problem("POST / HTTP/1.0\r\nTransfer-Encoding: chunked\r\n\r\n"),
            "HTTP/1.0 knows no Transfer-Encoding");
}

TEST(HttpHead, IsForOneHost) {
  EXPECT_EQ(http_head_problem("GET / HTTP/1.1\r\n\r\n"), "the header Host is missing");
  EXPECT_EQ(http_head_problem("GET / HTTP/1.1\r\nHost: a\r\nhost: b\r\n\r\n"),
            "the header Host stands there twice");
  EXPECT_EQ(http_head_problem("GET / HTTP/1.1\r\nHost: a\r\nHost: a\r\n\r\n"),
            "the header Host stands there twice");
  EXPECT_EQ(http_head_problem("GET / HTTP/1.1\r\nHost: a, b\r\n\r\n"), "the header Host names no host");
}

TEST(HttpHead, IsRefusedWherePartsOfItCouldBeJoinedInTwoWays) {
  constexpr std::string_view kFolded = "a header is folded over several lines";
  EXPECT_EQ(http_head_problem(post("X-Note: a\r\n b\r\n")), kFolded);
  EXPECT_EQ(http_head_problem(post("Transfer-Encoding:\r\n\tchunked\r\n")).empty(), false);
  EXPECT_EQ(http_head_problem("GET / HTTP/1.1\r\n Host: a\r\n\r\n"), kFolded);
  constexpr std::string_view kNoHttp = "this is not HTTP";
  for (const std::string& fields :
       {std::string("Content-Length : 3\r\n"), std::string("no colon\r\n"), std::string(": x\r\n"),
        std::string("X: a\nContent-Length: 3\r\n"), std::string("X: a\rContent-Length: 3\r\n"),
        std::string("X: a\0b\r\n", 8), std::string("X\x0B: a\r\n"), std::string("(X): a\r\n")}) {
    EXPECT_EQ(http_head_problem(post(fields)), kNoHttp) << fields;
  }
  for (const char* head :
       {"", "\r\n\r\n", "GET / HTTP/1.1\r\nHost: a\r\n", "\r\nGET / HTTP/1.1\r\nHost: a\r\n\r\n"}) {
    EXPECT_EQ(http_head_problem(head), kNoHttp) << head;
  }
}

}  // namespace
}  // namespace kiroku
