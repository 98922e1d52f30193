// Who is served next, and what is not taken in: with a clock that stands still until somebody
// works.
#include <gtest/gtest.h>

#include <algorithm>
#include <latch>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "server/dds/schedule/lane.h"

namespace trammel {
namespace {

using std::chrono::milliseconds;

/// One worker, or several that take portions one after the other, on a clock of their own.
struct Shop {
  explicit Shop(TurnLimits limits = {}, RoomLimits memory = {})
      : room(memory), lane(limits, room, 0, [this] { return now; }) {}

  SteadyTime now{};
  std::vector<std::string> log;               ///< client of each portion
  std::map<std::string, int> answered, shed;  ///< requests by client
  std::map<std::string, Cost> served;         ///< time of the workers by client
  milliseconds told{0};                       ///< when to try again, told last
  Room room;
  Lane lane;
};

/// Items that take so long each.
class Work final : public Job {
 public:
  Work(Shop& shop, std::string client, std::size_t items, milliseconds each)
      : shop_(shop), client_(std::move(client)), items_(items), each_(each) {}
  std::size_t begin() override { return items_; }
  void compute(std::size_t first, std::size_t count) override {
    EXPECT_EQ(first, computed_) << "an item was left out, or computed twice";
    computed_ += count;
    shop_.now += count * each_;
    shop_.served[client_] += count * each_;
    if (shop_.log.empty() || shop_.log.back() != client_) shop_.log.push_back(client_);
  }
  void finish() override {
    EXPECT_EQ(computed_, items_);
    ++shop_.answered[client_];
  }
  void shed(const Shed& shed) override {
    ++shop_.shed[client_];
    shop_.told = shed.retry_after;
  }

 private:
  Shop& shop_;
  const std::string client_;
  const std::size_t items_;
  const milliseconds each_;
  std::size_t computed_ = 0;
};

struct Wish {
  std::size_t items = 1;
  milliseconds each{1};
  milliseconds within{1000000};
  std::string cell = "cell-7";
};

bool ask(Shop& shop, const std::string& client, const Wish& wish) {
  const auto job = std::make_shared<Work>(shop, client, wish.items, wish.each);
  const SteadyTime by = shop.now + wish.within;
  const auto shed =
      shop.lane.submit(job, {client, wish.cell, "work of " + wish.cell, wish.items, 1000, by, by});
  if (shed) job->shed(*shed);
  return !shed;
}

void work_all(Shop& shop) {
  while (shop.lane.step()) continue;
}

/// Until the client has its answer.
void work_until_answered(Shop& shop, const std::string& client, int answers) {
  while (shop.answered[client] < answers) ASSERT_TRUE(shop.lane.step());
}

TEST(Turns, LimitsThatAreChangedHoldForTheNextRequest) {
  Shop shop;
  TurnLimits limits;
  limits.client_requests = 1;
  shop.lane.set_limits(limits);
  EXPECT_TRUE(ask(shop, "a", {}));
  EXPECT_FALSE(ask(shop, "a", {}));
  limits.client_requests = 2;
  shop.lane.set_limits(limits);
  EXPECT_TRUE(ask(shop, "a", {}));
  shop.room.set_limits({0, 0, 1});
  EXPECT_FALSE(ask(shop, "b", {})) << "there is no room";
  EXPECT_EQ(shop.lane.oldest_portion(), std::nullopt) << "nobody works";
}

TEST(Turns, AShortRequestWaitsForOnePortionOfALongOneAndNotForAllOfIt) {
  Shop shop;
  ASSERT_TRUE(ask(shop, "long", {10000}));
  ASSERT_TRUE(shop.lane.step());
  ASSERT_TRUE(ask(shop, "short", {1}));
  const Cost before = shop.served["long"];
  work_until_answered(shop, "short", 1);
  EXPECT_LE((shop.served["long"] - before).count(), 0.010);
  work_all(shop);
  EXPECT_EQ(shop.answered["long"], 1);
}

TEST(Turns, NoPortionIsLongerThanTenMillisecondsHoweverMuchAnItemCosts) {
  for (const int each : {1, 3, 9}) {
    Shop shop;
    ASSERT_TRUE(ask(shop, "long", {500, milliseconds(each)}));
    for (SteadyTime from = shop.now; shop.lane.step(); from = shop.now) {
      EXPECT_LE(shop.now - from, milliseconds(10)) << each;
    }
    EXPECT_EQ(shop.answered["long"], 1);
  }
}

TEST(Turns, AClientWhoFloodsGetsNoMoreTimeThanOneWhoSendsFew) {
  TurnLimits limits;
  limits.client_requests = 1000;
  Shop shop(limits);
  for (int i = 0; i < 200; ++i) ASSERT_TRUE(ask(shop, "many", {5}));
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(ask(shop, "few", {5}));
  work_until_answered(shop, "few", 20);
  EXPECT_NEAR(shop.served["many"].count(), shop.served["few"].count(), 0.010);
  work_all(shop);
  EXPECT_EQ(shop.answered["many"], 200);
}

TEST(Turns, TheTimeIsSharedByWhatIsUsedAndNotByTheNumberOfRequests) {
  Shop shop;
  ASSERT_TRUE(ask(shop, "long", {2000}));
  for (int i = 0; i < 64; ++i) ASSERT_TRUE(ask(shop, "short", {1, milliseconds(2)}));
  work_until_answered(shop, "short", 64);
  EXPECT_NEAR(shop.served["long"].count(), shop.served["short"].count(), 0.010);
}

TEST(Turns, AnHonestClientAmongSixteenFloodersIsNextEachTimeItComes) {
  Shop shop;
  const auto flood = [&] {
    for (int k = 0; k < 16; ++k) {
      while (ask(shop, "flooder " + std::to_string(k), {500})) continue;
    }
  };
  flood();
  for (int i = 0; i < 100; ++i) {
    for (int k = 0; k < 50; ++k) ASSERT_TRUE(shop.lane.step());
    const SteadyTime asked = shop.now;
    ASSERT_TRUE(ask(shop, "honest", {1}));
    work_until_answered(shop, "honest", i + 1);
    EXPECT_LE(shop.now - asked, milliseconds(10)) << i;
    flood();
  }
  EXPECT_EQ(shop.shed["honest"], 0);
}

TEST(Turns, WhoComesBackAfterAFloodHasNotLostItsPlaceButNotGainedOneEither) {
  Shop shop;
  for (int i = 0; i < 60; ++i) ASSERT_TRUE(ask(shop, "early", {10}));
  ASSERT_TRUE(ask(shop, "steady", {100000}));
  work_until_answered(shop, "early", 60);
  const Cost early = shop.served["early"], steady = shop.served["steady"];
  for (int i = 0; i < 60; ++i) ASSERT_TRUE(ask(shop, "early", {10}));
  work_until_answered(shop, "early", 120);
  EXPECT_NEAR((shop.served["early"] - early).count(), (shop.served["steady"] - steady).count(),
              0.020);
}

TEST(Turns, SixtyFourRequestsOfAClientWaitAndTheNextIsToldWhenToTryAgain) {
  Shop shop;
  for (int i = 0; i < 64; ++i) ASSERT_TRUE(ask(shop, "many", {1}));
  EXPECT_FALSE(ask(shop, "many", {1}));
  EXPECT_GT(shop.told.count(), 0);
  EXPECT_TRUE(ask(shop, "other", {1}));
  ASSERT_TRUE(shop.lane.step());
  work_all(shop);
  EXPECT_TRUE(ask(shop, "many", {1}));
  work_all(shop);
  EXPECT_EQ(shop.answered["many"], 65);
}

TEST(Turns, EveryRequestIsAnsweredOrShedExactlyOnceWhateverComes) {
  TurnLimits limits;
  limits.requests = 300;
  Shop shop(limits, {200000, 100000, 0.5});
  std::uint64_t seed = 1;
  const auto draw = [&](std::uint64_t below) {
    seed = seed * 6364136223846793005u + 1442695040888963407u;
    return (seed >> 33) % below;
  };
  std::map<std::string, int> sent;
  for (int i = 0; i < 5000; ++i) {
    const std::string client = "client " + std::to_string(draw(12));
    const Wish wish{draw(40), milliseconds(draw(4)), milliseconds(draw(400)),
                    "cell-" + std::to_string(draw(3))};
    ++sent[client];
    static_cast<void>(ask(shop, client, wish));
    for (std::uint64_t k = draw(6); k > 0; --k) static_cast<void>(shop.lane.step());
  }
  shop.lane.stop();
  int shed = 0, answered = 0;
  for (const auto& [client, count] : sent) {
    EXPECT_EQ(shop.answered[client] + shop.shed[client], count) << client;
    shed += shop.shed[client];
    answered += shop.answered[client];
  }
  EXPECT_GT(shed, 100);
  EXPECT_GT(answered, 100);
  EXPECT_EQ(shop.lane.requests(), 0U);
  EXPECT_EQ(shop.room.bytes(), 0U);
}

TEST(Turns, WhatCannotBeDoneInTimeIsShedAtOnceAndWhatCanIsDone) {
  TurnLimits limits;
  limits.workers = 1;
  Shop shop(limits);
  ASSERT_TRUE(ask(shop, "a", {100}));  // 1 ms an item is known now
  work_all(shop);
  ASSERT_TRUE(ask(shop, "a", {1000}));
  EXPECT_FALSE(ask(shop, "b", {1000, milliseconds(1), milliseconds(1500)}))
      << "they take turns: 2 s";
  EXPECT_GE(shop.told, milliseconds(450));
  EXPECT_LE(shop.told, milliseconds(1000));
  EXPECT_TRUE(ask(shop, "b", {400, milliseconds(1), milliseconds(1500)}))
      << "400 ms of b, 400 ms of a meanwhile";
  work_all(shop);
  EXPECT_EQ(shop.answered["b"], 1);
}

TEST(Turns, ALongRequestOfAnotherDoesNotShedAShortOne) {
  Shop shop;
  ASSERT_TRUE(ask(shop, "a", {100}));
  work_all(shop);
  ASSERT_TRUE(ask(shop, "a", {100000}));
  EXPECT_TRUE(ask(shop, "b", {1, milliseconds(1), milliseconds(20)}));
  work_until_answered(shop, "b", 1);
  EXPECT_EQ(shop.shed["b"], 0);
}

TEST(Turns, NobodyWorksForAClientThatNoLongerWaits) {
  Shop shop;
  ASSERT_TRUE(ask(shop, "gone", {1000, milliseconds(1), milliseconds(100)}))
      << "nothing is known of its cost yet";
  work_all(shop);
  EXPECT_EQ(shop.shed["gone"], 1);
  EXPECT_LE(shop.served["gone"].count(), 0.110);
}

TEST(Turns, WhatWaitsPastItsTimeIsToldSoThoughNoWorkerComes) {
  Shop shop;
  ASSERT_TRUE(ask(shop, "a", {1, milliseconds(1), milliseconds(100)}));
  ASSERT_TRUE(ask(shop, "b", {1, milliseconds(1), milliseconds(1000)}));
  shop.lane.shed_late();
  EXPECT_EQ(shop.shed["a"], 0);
  shop.now += milliseconds(200);
  shop.lane.shed_late();
  EXPECT_EQ(shop.shed["a"], 1);
  EXPECT_EQ(shop.shed["b"], 0);
  work_all(shop);
  EXPECT_EQ(shop.answered["b"], 1);
  EXPECT_EQ(shop.answered["a"], 0);
}

/// Computes until it is let go.
class LongWork final : public Job {
 public:
  std::size_t begin() override { return 1; }
  void compute(std::size_t, std::size_t) override {
    begun.count_down();
    let_go.wait();
  }
  void finish() override {}
  void shed(const Shed&) override {}
  std::latch begun{1}, let_go{1};
};

TEST(Turns, WorkThatTakesLongBesideIdleWorkersIsNoHang) {
  TurnLimits limits;
  limits.workers = 4;
  limits.cell_workers = 1;
  Room room({});
  Lane lane(limits, room);
  lane.start();
  const auto first = std::make_shared<LongWork>(), second = std::make_shared<LongWork>();
  const SteadyTime by = std::chrono::steady_clock::now() + std::chrono::hours(1);
  ASSERT_FALSE(lane.submit(first, {"a", "cell-7", "import", 1, 1000, by}));
  first->begun.wait();
  EXPECT_FALSE(lane.unseen()) << "nothing waits for a worker";
  ASSERT_FALSE(lane.submit(second, {"a", "cell-7", "import", 1, 1000, by}));
  first->let_go.count_down();
  second->begun.wait();
  EXPECT_FALSE(lane.unseen());
  second->let_go.count_down();
  lane.stop();
}

TEST(Turns, AFigureOfAStalledMachineDoesNotShutAClientOutForEver) {
  Shop shop;
  ASSERT_TRUE(ask(shop, "a", {1, milliseconds(60000)}));
  work_all(shop);
  EXPECT_FALSE(ask(shop, "a", {1, milliseconds(1), milliseconds(100)}));
  shop.now += milliseconds(30000);
  EXPECT_TRUE(ask(shop, "a", {1, milliseconds(1), milliseconds(100)}));
}

TEST(Turns, TheRequestsOfOneCellTakeNoMoreThanTheirShareOfTheRoom) {
  TurnLimits limits;
  limits.requests = 100;
  Shop shop(limits);
  int taken = 0;
  for (int i = 0; i < 10; ++i) {
    for (int k = 0; k < 10; ++k) taken += ask(shop, "client " + std::to_string(i), {1}) ? 1 : 0;
  }
  EXPECT_EQ(taken, 50);
  EXPECT_TRUE(ask(shop, "client 11", {1, milliseconds(1), milliseconds(1000000), "cell-8"}));
}

// Half of one place is none: the first request was answered, and no other ever.
TEST(Turns, ACellHasOnePlaceHoweverSmallItsShare) {
  TurnLimits limits;
  limits.requests = 1;
  Shop shop(limits);
  for (int i = 0; i < 3; ++i) {
    EXPECT_TRUE(ask(shop, "a", {}));
    work_all(shop);
  }
}

TEST(Turns, TheMemoryOfWaitingRequestsIsBoundedForAClientACellAndAll) {
  Shop shop({}, {20000, 5000, 0.5});
  const auto fill = [&](const std::string& client, const std::string& cell) {
    int taken = 0;
    while (ask(shop, client, {1, milliseconds(1), milliseconds(1000000), cell})) ++taken;
    return taken;
  };
  EXPECT_EQ(fill("a", "cell-7"), 4);
  EXPECT_EQ(fill("b", "cell-7"), 4);
  EXPECT_EQ(fill("c", "cell-7"), 1) << "the cell's share is used up";
  EXPECT_EQ(fill("c", "cell-8"), 3);
  EXPECT_EQ(fill("d", "cell-8"), 4);
  EXPECT_EQ(fill("e", "cell-8"), 2);
  EXPECT_EQ(fill("e", ""), 1) << "all of it is used up";
  work_all(shop);
  EXPECT_EQ(shop.room.bytes(), 0U);
}

/// Portions that are taken up and not given back, as if workers were at them.
struct Held {
  Room room{RoomLimits{}};
  Turns turns;
  Shop shop;
  explicit Held(const TurnLimits& limits) : turns(limits) {}

  void add(const std::string& client, const std::string& cell, std::size_t items = 1) {
    const SteadyTime by = SteadyTime() + std::chrono::hours(1);
    EXPECT_FALSE(turns.add(std::make_shared<Work>(shop, client, items, milliseconds(1)),
                           {client, cell, "", items, 1, by, by}, *room.take(client, cell, 1),
                           SteadyTime()));
  }
  [[nodiscard]] std::optional<Turns::Portion> next() { return turns.next(SteadyTime()); }
};

TEST(Turns, ALongRequestGoesToAllWorkersWhenNobodyElseWaits) {
  Held held({});
  held.add("a", "cell-7", 10000);
  const auto first = held.next();
  ASSERT_TRUE(first);
  EXPECT_FALSE(held.next()) << "it is being looked up";
  held.turns.open(*first->entry, 10000);
  const auto second = held.next();
  ASSERT_TRUE(second);
  EXPECT_EQ(second->entry, first->entry);
  EXPECT_EQ(second->part, Turns::Part::kCompute);
  held.add("b", "cell-7");
  const auto third = held.next();
  ASSERT_TRUE(third);
  EXPECT_NE(third->entry, first->entry)
      << "whoever waits comes before a third worker for the same request";
}

TEST(Turns, AnExpressWorkerTakesUpShortRequestsOnly) {
  Shop shop;
  for (const char* client : {"long", "short"})
    ASSERT_TRUE(ask(shop, client, {1}));  // 1 ms an item is known now
  work_all(shop);
  ASSERT_TRUE(ask(shop, "long", {500}));
  EXPECT_FALSE(shop.lane.step(Turns::Which::kShort));
  ASSERT_TRUE(ask(shop, "short", {1}));
  EXPECT_TRUE(shop.lane.step(Turns::Which::kShort));
  EXPECT_EQ(shop.answered["short"], 2);
  EXPECT_FALSE(shop.lane.step(Turns::Which::kShort));
  work_all(shop);
  EXPECT_EQ(shop.answered["long"], 2);
}

TEST(Turns, ChangesOfOneCellComeOneAfterTheOtherAndDoNotHoldUpAnotherCell) {
  TurnLimits limits;
  limits.workers = 8;
  limits.cell_workers = 1;
  limits.client_workers = 4;
  Held held(limits);
  for (int i = 0; i < 3; ++i) held.add("a", "cell-7");
  held.add("a", "cell-8");
  held.add("b", "cell-7");
  held.add("b", "cell-9");
  std::vector<Turns::Portion> portions;
  while (auto portion = held.next()) portions.push_back(std::move(*portion));
  EXPECT_EQ(portions.size(), 3U) << "one each of the cells 7, 8 and 9";
  EXPECT_FALSE(held.turns.settle(portions[0], {Cost(1), Cost(1), 1, true}, SteadyTime()));
  EXPECT_TRUE(held.next()) << "the next change of the first cell";
}

TEST(Turns, OneClientDoesNotOccupyAllWorkersThatCannotBeInterrupted) {
  TurnLimits limits;
  limits.workers = 4;
  limits.client_workers = 2;
  Held held(limits);
  for (int i = 0; i < 10; ++i) held.add("a", "cell-" + std::to_string(i));
  EXPECT_TRUE(held.next());
  EXPECT_TRUE(held.next());
  EXPECT_FALSE(held.next());
  held.add("b", "cell-1");
  EXPECT_TRUE(held.next());
}

}  // namespace
}  // namespace trammel
