// Who has a reply channel, and who listens where.
#include "server/dds/schedule/channel_book.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "server/dds/schedule/outbox.h"

namespace trammel {
namespace {

using std::chrono::milliseconds;
using Kind = ChannelBook::Change::Kind;

/// A book, with the channels that it has had opened.
struct Desk {
  explicit Desk(std::size_t capacity) : book(capacity, milliseconds(1000)) {}

  void comes(const std::string& name) {
    book.found({"participant of " + name, name, "PredictError_Reply"}, now);
    book.found({"participant of " + name, name, "CorrectTarget_Reply"}, now);
  }
  void leaves(const std::string& name) { book.left("participant of " + name); }
  void asks(const std::string& name) {
    static_cast<void>(book.asked(name, now));
    book.answered(name, now);
  }
  void tend(milliseconds later = milliseconds(0)) {
    now += later;
    for (const auto& change : book.changes(now)) {
      if (change.kind == Kind::kOpen) {
        open[change.partition].insert(change.topic);
      } else {
        open.erase(change.partition);
      }
    }
    EXPECT_EQ(open.size(), book.open());
  }
  [[nodiscard]] bool has(const std::string& name) const { return open.contains(name); }

  SteadyTime now{};
  ChannelBook book;
  std::map<std::string, std::set<std::string>> open;  ///< topics by partition
};

TEST(ChannelBook, AClientThatIsFoundGetsAWriterForEachTopicItListensTo) {
  Desk desk(2);
  desk.comes("a");
  desk.tend();
  EXPECT_EQ(desk.open["a"], (std::set<std::string>{"PredictError_Reply", "CorrectTarget_Reply"}));
  desk.book.found({"participant of a", "a", "Train_Reply"}, desk.now);
  desk.tend();
  EXPECT_EQ(desk.open["a"].size(), 3U);
  desk.leaves("a");
  desk.tend();
  EXPECT_TRUE(desk.open.empty());
}

TEST(ChannelBook, ANewcomerBeyondTheLimitGetsTheChannelOfTheOneThatHasBeenSilentLongest) {
  Desk desk(2);
  desk.comes("a");
  desk.comes("b");
  desk.tend();
  desk.tend(milliseconds(2000));
  desk.asks("a");
  desk.comes("c");
  desk.tend(milliseconds(100));
  EXPECT_TRUE(desk.has("a"));
  EXPECT_FALSE(desk.has("b"));
  EXPECT_TRUE(desk.has("c"));
}

TEST(ChannelBook, WhoeverWaitsToBeMatchedIsServedInBoundedTimeHoweverManyThereAre) {
  Desk desk(4);
  std::set<std::string> waiting;
  for (int i = 0; i < 40; ++i) {
    desk.comes("client " + std::to_string(i));
    waiting.insert("client " + std::to_string(i));
  }
  int looks = 0;
  while (!waiting.empty() && looks < 100) {
    desk.tend(milliseconds(200));
    ++looks;
    for (const auto& [name, topics] : desk.open) waiting.erase(name);
  }
  EXPECT_TRUE(waiting.empty()) << waiting.size() << " of 40 never had a channel";
  EXPECT_LE(looks, 60) << "ten times four channels, one second each";
}

TEST(ChannelBook, AClientWhoseRequestIsNotAnsweredKeepsItsChannel) {
  Desk desk(1);
  desk.comes("a");
  desk.tend();
  EXPECT_FALSE(desk.book.asked("a", desk.now)) << "it has a channel";
  desk.comes("b");
  desk.tend(milliseconds(5000));
  EXPECT_TRUE(desk.has("a"));
  desk.book.answered("a", desk.now);
  desk.tend(milliseconds(1500));
  EXPECT_TRUE(desk.has("b"));
}

TEST(ChannelBook, AClientThatLostItsChannelAndAsksComesBeforeThoseWhoOnlyListen) {
  Desk desk(1);
  desk.comes("a");
  desk.tend();
  for (const char* name : {"b", "c", "d"}) desk.comes(name);
  desk.tend(milliseconds(1500));
  EXPECT_TRUE(desk.has("b"));
  desk.asks("a");
  desk.tend(milliseconds(1500));
  EXPECT_TRUE(desk.has("a"));
}

TEST(ChannelBook, ClientsThatDoNothingChangePlacesMoreAndMoreSeldom) {
  Desk desk(1);
  desk.comes("a");
  desk.comes("b");
  std::string holder;
  int changes = 0;
  for (int i = 0; i < 3000; ++i) {  // ten minutes
    desk.tend(milliseconds(200));
    const std::string now = desk.open.begin()->first;
    changes += now != holder ? 1 : 0;
    holder = now;
  }
  EXPECT_LE(changes, 60);
  EXPECT_GE(changes, 10);
}

TEST(ChannelBook, AmongFewWhoeverWaitsToBeMatchedAgainWaitsForTwelveSecondsAtMost) {
  Desk desk(2);
  const std::vector<std::string> names = {"a", "b", "c", "d"};
  std::map<std::string, milliseconds> waited;
  for (const std::string& name : names) desk.comes(name);
  milliseconds longest{0};
  for (int i = 0; i < 1500; ++i) {  // five minutes
    constexpr milliseconds kLook{200};
    desk.tend(kLook);
    for (const std::string& name : names) {
      waited[name] = desk.has(name) ? milliseconds(0) : waited[name] + kLook;
      longest = std::max(longest, waited[name]);
    }
  }
  EXPECT_LE(longest, milliseconds(12'400));
}

TEST(ChannelBook, AParticipantThatComesUnderOneNameAfterTheOtherOpensFewChannels) {
  Desk desk(4);
  desk.comes("honest");
  desk.tend();
  std::set<std::string> opened;
  for (int i = 0; i < 2000; ++i) {  // 200 a second
    const std::string name = "name " + std::to_string(i);
    desk.book.found({"flapper", name, "PredictError_Reply"}, desk.now);
    static_cast<void>(desk.book.asked(name, desk.now));
    desk.tend(milliseconds(5));
    if (desk.has(name)) opened.insert(name);
    desk.book.lost({"flapper", name, "PredictError_Reply"});
    desk.tend();
  }
  EXPECT_LE(opened.size(), 30u);
  EXPECT_GE(opened.size(), 8u) << "who comes again now and then";
  EXPECT_TRUE(desk.has("honest"));
  for (const char* name : {"a", "b", "c"})
    desk.book.found({"other", name, "PredictError_Reply"}, desk.now);
  desk.tend();
  for (const char* name : {"a", "b", "c"}) EXPECT_TRUE(desk.has(name)) << "somebody else";
}

TEST(ChannelBook, OnlyTheFirstWhoListensInAPartitionIsAnsweredThere) {
  Desk desk(4);
  desk.comes("a");
  desk.book.found({"a stranger", "a", "PredictError_Reply"}, desk.now);
  EXPECT_TRUE(desk.book.may_listen("participant of a", "a"));
  EXPECT_FALSE(desk.book.may_listen("a stranger", "a"));
  EXPECT_TRUE(desk.book.may_listen("a stranger", "somewhere else"))
      << "its reader may be found in a moment";
  EXPECT_FALSE(desk.book.listens("a stranger", "somewhere else"));
  desk.book.lost({"a stranger", "a", "PredictError_Reply"});
  desk.leaves("b");
  desk.tend();
  EXPECT_TRUE(desk.has("a"));
}

TEST(ChannelBook, AClientThatIsStartedAgainUnderItsNameFollowsTheOneThatDied) {
  Desk desk(4);
  desk.comes("a");
  desk.tend();
  desk.book.found({"a, started again", "a", "PredictError_Reply"}, desk.now);
  desk.tend();
  EXPECT_FALSE(desk.book.may_listen("a, started again", "a")) << "the first one may still be there";
  desk.leaves("a");
  desk.tend();
  EXPECT_TRUE(desk.book.listens("a, started again", "a"));
  EXPECT_EQ(desk.open["a"], std::set<std::string>{"PredictError_Reply"});
}

TEST(ChannelBook, OneParticipantThatListensInAThousandPartitionsTakesFewChannels) {
  Desk desk(100);
  for (int i = 0; i < 1000; ++i)
    desk.book.found({"one", "p" + std::to_string(i), "PredictError_Reply"}, desk.now);
  desk.comes("honest");
  for (int i = 0; i < 100; ++i) desk.tend(milliseconds(200));
  EXPECT_LE(desk.open.size(), 10U);
  EXPECT_TRUE(desk.has("honest"));
}

Parcel parcel(const std::string& client, std::size_t bytes, SteadyTime until = {}) {
  return {client, "partition of " + client, "PredictError_Reply", nullptr, bytes, until};
}

TEST(Outbox, IsBoundedForAClientAndForAll) {
  Outbox outbox({3, 1000, 1500});
  EXPECT_TRUE(outbox.put(parcel("a", 10)));
  EXPECT_TRUE(outbox.put(parcel("a", 10)));
  EXPECT_TRUE(outbox.put(parcel("a", 10)));
  EXPECT_FALSE(outbox.put(parcel("a", 10))) << "three of a client";
  EXPECT_FALSE(outbox.put(parcel("b", 1001)));
  EXPECT_TRUE(outbox.put(parcel("b", 1000)));
  EXPECT_FALSE(outbox.put(parcel("c", 500)));
  EXPECT_EQ(outbox.take(10, [](const Parcel& one) { return one.client == "b"; }).size(), 1U);
  EXPECT_TRUE(outbox.put(parcel("c", 500)));
  EXPECT_EQ(outbox.bytes(), 530U);
}

TEST(Outbox, DropsAndCountsWhatNobodyFetched) {
  Outbox outbox({10, 1000, 1000});
  const SteadyTime later = SteadyTime() + milliseconds(10);
  ASSERT_TRUE(outbox.put(parcel("a", 1, SteadyTime() + milliseconds(1))));
  ASSERT_TRUE(outbox.put(parcel("a", 1, later + milliseconds(1))));
  EXPECT_EQ(outbox.expire(later), 1U);
  EXPECT_EQ(outbox.take(10, [](const Parcel&) { return true; }).size(), 1U);
  EXPECT_TRUE(outbox.empty());
  EXPECT_EQ(outbox.bytes(), 0U);
}

}  // namespace
}  // namespace trammel
