#include "server/http/bounded_server.h"

#include <gtest/gtest.h>

#include <deque>
#include <latch>
#include <memory>
#include <semaphore>
#include <vector>

#include "tests/support/http_client.h"
#include "tests/support/own_ports.h"

namespace trammel {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using test::http_exchange;
using test::http_get;
using test::OpenConnection;
using test::parse_http;

class BoundedServerTest : public testing::Test {
 protected:
  void start(const HttpLimits& limits = {}, HttpHandler handler = echo) {
    auto started = BoundedServer::start("127.0.0.1", kPort, limits, std::move(handler));
    ASSERT_TRUE(started) << started.error().message;
    server_ = std::move(*started);
  }
  static HttpReply echo(const HttpAsk& ask) {
    std::string text;
    for (const std::string& word : ask.path) text += word + "|";
    for (const auto& [name, value] : ask.options) text += name + "=" + value + "|";
    return {200, "text/plain; charset=utf-8", text};
  }
  static int code_of(const std::string& request) {
    return parse_http(http_exchange(kPort, request)).code;
  }

  inline static const auto kPort = test::own_ports();
  std::unique_ptr<BoundedServer> server_;
};

TEST_F(BoundedServerTest, AnswersWithTheWordsOfThePathAndTheOptions) {
  start();
  EXPECT_EQ(http_get(kPort, "/cells/a%20b/models/3?cell=x%2Fy").body,
            "cells|a b|models|3|cell=x/y|");
  EXPECT_EQ(http_get(kPort, "/").body, "");
}

TEST_F(BoundedServerTest, TakesNothingButReading) {
  start();
  EXPECT_EQ(code_of("POST / HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 3\r\n\r\nabc"), 405);
  EXPECT_EQ(code_of("DELETE /cells/a HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n"), 405);
  const auto head = parse_http(http_exchange(kPort, "HEAD /a HTTP/1.1\r\nHost: localhost\r\n\r\n"));
  EXPECT_EQ(head.code, 200);
  EXPECT_EQ(head.body, "");
}

// The library bounds neither a body in pieces nor one that grows when it is unpacked.
TEST_F(BoundedServerTest, ABodyIsTakenOnlyBelowItsWordAndOnlyWhole) {
  HttpLimits limits;
  limits.posts = HttpPosts();
  limits.posts->word = "api";
  limits.posts->body = 8;
  start(limits, [](const HttpAsk& ask) -> HttpReply { return {200, "text/plain", ask.body}; });
  const auto post = [](const std::string& path, const std::string& headers,
                       const std::string& body) {
    return parse_http(http_exchange(
        kPort, "POST " + path + " HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n" + headers +
                   "\r\n" + body));
  };
  const std::string json = "Content-Type: application/json\r\n";
  EXPECT_EQ(post("/api/a", json + "Content-Length: 3\r\n", "abc").body, "abc");
  EXPECT_EQ(post("/jobs", json + "Content-Length: 3\r\n", "abc").code, 405);
  EXPECT_EQ(post("/api/a", json + "Content-Length: 9\r\n", "abcabcabc").code, 413);
  EXPECT_EQ(post("/api/a", json + "Transfer-Encoding: chunked\r\n", "3\r\nabc\r\n0\r\n\r\n").code,
            411);
  EXPECT_EQ(post("/api/a", json + "Content-Encoding: gzip\r\nContent-Length: 3\r\n", "abc").code,
            415);
  EXPECT_EQ(post("/api/a", "Content-Type: text/plain\r\nContent-Length: 3\r\n", "abc").code, 415)
      << "any page could send that";
}

/// A server that gives back what is posted, by one worker.
HttpLimits echoing_limits() {
  HttpLimits limits;
  limits.posts = HttpPosts();
  limits.posts->word = "api";
  limits.posts->workers = 1;
  limits.posts->body = 256;
  return limits;
}

HttpReply echo_body(const HttpAsk& ask) { return {200, "text/plain", ask.body}; }

std::string post_of(const std::string& body, const std::string& type = "application/json") {
  return "POST /api/a HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: " + type +
         "\r\nContent-Length: " + std::to_string(body.size()) + "\r\n\r\n" + body;
}

// One worker would be held up by one idle client if that client kept it.
TEST_F(BoundedServerTest, AConnectionHasManyRequestsAndOccupiesNoWorkerBetweenThem) {
  start(echoing_limits(), echo_body);
  const OpenConnection first(kPort), second(kPort);
  for (const char* body : {"one", "two", "three"}) {
    for (const OpenConnection* connection : {&first, &second}) {
      connection->send(post_of(body));
      const std::string answer = connection->read_answer(seconds(10));
      EXPECT_EQ(parse_http(answer).body, body);
      EXPECT_EQ(answer.find("Connection: close"), std::string::npos) << answer;
    }
  }
  server_.reset();
  EXPECT_TRUE(first.closes_within(seconds(10)));
}

// What is left of a refused request must not be taken for the next one.
TEST_F(BoundedServerTest, TheUnreadBodyOfARefusedRequestIsNoRequest) {
  start(echoing_limits(), echo_body);
  const std::string hidden = post_of("hidden");
  const std::string long_one = hidden + std::string(300, ' ');
  for (const std::string& sent : {post_of(hidden, "text/plain"), post_of(long_one)}) {
    const std::string answers = http_exchange(kPort, sent);
    EXPECT_EQ(answers.find("hidden"), std::string::npos) << answers;
    EXPECT_NE(answers.find("Connection: close"), std::string::npos) << answers;
  }
  const OpenConnection slow(kPort);  // its body would come behind the answer
  const std::string sent = post_of(hidden, "text/plain");
  slow.send(sent.substr(0, sent.find("\r\n\r\n") + 4));
  EXPECT_EQ(parse_http(slow.read(seconds(5))).code, 415);
  EXPECT_TRUE(slow.closes_within(milliseconds(1)));
  const std::string twice =
      "POST /api/a HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
      "Content-Length: 3\r\nContent-Length: 300\r\n\r\nabc";
  EXPECT_NE(http_exchange(kPort, twice + hidden).find("Connection: close"), std::string::npos);
}

TEST_F(BoundedServerTest, AnIdleConnectionMakesRoomForANewOne) {
  HttpLimits limits = echoing_limits();
  limits.waiting = 2;
  start(limits, echo_body);
  const OpenConnection idle(kPort), other(kPort);
  for (const OpenConnection* connection : {&idle, &other}) {
    connection->send(post_of("x"));
    EXPECT_EQ(parse_http(connection->read_answer(seconds(10))).code, 200);
  }
  const OpenConnection late(kPort);
  EXPECT_TRUE(idle.closes_within(seconds(5)));
  EXPECT_EQ(server_->shed(), 0u);
  late.send(post_of("y"));
  EXPECT_EQ(parse_http(late.read_answer(seconds(10))).body, "y");
}

TEST_F(BoundedServerTest, AnswersToNamesOfThisHostOnly) {
  start();
  for (const char* host : {"127.0.0.1", "127.0.0.1:9464", "localhost", "localhost:80", "127.1.2.3"})
    EXPECT_EQ(code_of(std::string("GET / HTTP/1.1\r\nHost: ") + host + "\r\n\r\n"), 200) << host;
  for (const char* host :
       {"evil.example", "127.0.0.1.evil.example", "10.0.0.1", "", "127.0.0.1@evil.example"})
    EXPECT_EQ(code_of(std::string("GET / HTTP/1.1\r\nHost: ") + host + "\r\n\r\n"), 421) << host;
}

TEST_F(BoundedServerTest, BytesThatAreNoRequestEndTheirConnectionAndNothingElse) {
  start();
  const std::string long_line(20000, 'a'), deep = "/" + std::string(1900, '/');
  for (const std::string& bytes :
       {std::string("\r\n\r\n"), std::string("GET\r\n\r\n"), std::string(3000, '\0'),
        "GET /" + long_line + " HTTP/1.1\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: localhost\r\nX: " + long_line + "\r\n\r\n",
        "GET " + deep + " HTTP/1.1\r\nHost: localhost\r\n\r\n",
        std::string("GET /%zz%00%ff HTTP/1.1\r\nHost: localhost\r\n\r\n"),
        "GET / HTTP/1.1\r\nHost: localhost\r\nRange: bytes=" + std::string(4000, '0') + "-\r\n\r\n",
        "GET / HTTP/1.1\r\nHost: localhost\r\nRange: bytes=0-0" +
            [] {
              std::string more;
              for (int i = 0; i < 1800; ++i) more += ",1-1";
              return more;
            }() +
            "\r\n\r\n",
        std::string("GET / HTTP/1.1\r\nHost: localhost\r\nContent-Length: -5\r\nTransfer-Encoding: "
                    "chunked\r\n\r\nzz\r\n")}) {
    static_cast<void>(http_exchange(kPort, bytes, seconds(5)));
    EXPECT_EQ(http_get(kPort, "/still").body, "still|") << bytes.substr(0, 60);
  }
}

TEST_F(BoundedServerTest, WhoeverSendsSlowlyIsCutOffAndHoldsUpNobodyForLong) {
  HttpLimits limits;
  limits.workers = 2;
  limits.reading = milliseconds(300);
  start(limits);
  std::vector<std::unique_ptr<OpenConnection>> slow;
  for (int i = 0; i < 8; ++i) {
    slow.push_back(std::make_unique<OpenConnection>(kPort));
    slow.back()->send("GET / HT");
  }
  EXPECT_EQ(http_get(kPort, "/a").code, 200) << "behind four times the time for a request";
  for (const auto& connection : slow) EXPECT_TRUE(connection->closes_within(seconds(20)));
}

TEST_F(BoundedServerTest, WhoeverComesSlowlyAgainAndAgainHoldsUpNobodyElse) {
  start();
  std::deque<OpenConnection> slow;
  for (int round = 0; round < 20; ++round) {
    for (int i = 0; i < 40; ++i) slow.emplace_back(kPort).send("GET / HT");
    while (slow.size() > 120) slow.pop_front();
    for (const OpenConnection& one : slow) one.send("T");
    EXPECT_EQ(http_get(kPort, "/healthz").code, 200) << round;
  }
  EXPECT_GE(server_->shed(), 700u);
}

TEST_F(BoundedServerTest, WhereTooManyAreSlowTheSlowestIsSentAwayAndCounted) {
  HttpLimits limits;
  limits.workers = 1;
  limits.waiting = 2;
  limits.reading = seconds(20);
  start(limits);
  std::vector<std::unique_ptr<OpenConnection>> waiting;
  for (int i = 0; i < 6; ++i) waiting.push_back(std::make_unique<OpenConnection>(kPort));
  for (int i = 0; i < 4; ++i) EXPECT_EQ(parse_http(waiting[i]->read(seconds(10))).code, 503) << i;
  EXPECT_EQ(server_->shed(), 4u);
  waiting[4]->send("GET /fifth HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_EQ(parse_http(waiting[4]->read(seconds(10))).body, "fifth|");
}

TEST_F(BoundedServerTest, MoreRequestsThanMayWaitAreSentAwayAtOnce) {
  HttpLimits limits;
  limits.workers = 1;
  limits.waiting = 2;
  std::counting_semaphore<> begun(0);
  std::latch over(1);
  start(limits, [&](const HttpAsk&) -> HttpReply {
    begun.release();
    over.wait();
    return {200, "text/plain; charset=utf-8", "late"};
  });
  std::vector<std::unique_ptr<OpenConnection>> waiting;
  for (int i = 0; i < 6; ++i) {
    waiting.push_back(std::make_unique<OpenConnection>(kPort));
    waiting.back()->send("GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
    if (i == 0) begun.acquire();  // until its request is read, it is one of those that are slow
  }
  EXPECT_EQ(parse_http(waiting.back()->read(seconds(10))).code, 503);
  over.count_down();
  EXPECT_EQ(parse_http(waiting.front()->read(seconds(10))).body, "late")
      << "who came first is served";
  server_.reset();  // its handler waits for the latch
}

TEST_F(BoundedServerTest, WhatHasAWorkerOfItsOwnIsAnsweredWhileEverythingElseIsHeldUp) {
  HttpLimits limits;
  limits.workers = 1;
  limits.apart = {"healthz"};
  std::counting_semaphore<> begun(0);
  std::latch over(1);
  start(limits, [&](const HttpAsk& ask) -> HttpReply {
    if (ask.path != std::vector<std::string>{"healthz"}) {
      begun.release();
      over.wait();
    }
    return echo(ask);
  });
  std::vector<std::unique_ptr<OpenConnection>> others;
  for (int i = 0; i < 100; ++i) {
    others.push_back(std::make_unique<OpenConnection>(kPort));
    others.back()->send("GET /page HTTP/1.1\r\nHost: localhost\r\n\r\n");
    if (i == 0) begun.acquire();  // until its request is read, it is one of those that are slow
  }
  EXPECT_EQ(http_get(kPort, "/healthz").body, "healthz|");
  over.count_down();
  EXPECT_EQ(parse_http(others.front()->read(seconds(10))).body, "page|");
  server_.reset();  // its handler waits for the latch
}

TEST_F(BoundedServerTest, AHandlerThatThrowsIsAnAnswer) {
  start({}, [](const HttpAsk&) -> HttpReply { throw std::runtime_error("no memory"); });
  EXPECT_EQ(http_get(kPort, "/").code, 500);
  EXPECT_EQ(http_get(kPort, "/").code, 500);
}

TEST_F(BoundedServerTest, APortThatIsTakenAndAnAddressThatLeavesThisHostAreRefused) {
  start();
  const auto second = BoundedServer::start("127.0.0.1", kPort, {}, echo);
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kConflict);
  for (const char* address : {"0.0.0.0", "192.168.1.4", "localhost", "::1", "", "128.0.0.1"})
    EXPECT_FALSE(BoundedServer::start(address, static_cast<std::uint16_t>(kPort + 1), {}, echo))
        << address;
}

TEST_F(BoundedServerTest, EndsWhileConnectionsWait) {
  start();
  const OpenConnection idle(kPort);
  server_.reset();
  EXPECT_TRUE(idle.closes_within(seconds(20)));
  start();
  EXPECT_EQ(http_get(kPort, "/again").body, "again|");
}

}  // namespace
}  // namespace trammel
