#include <gtest/gtest.h>

#include "clients/cam/flow.h"

namespace trammel::cam {
namespace {

using Kind = Step::Kind;

/// Which numbers may hold before each step, where a step with a number in its label sets it.
std::vector<std::set<int>> numbers_before(const std::vector<Step>& steps,
                                          bool in_any_order = false) {
  return states_before(
      flow_of(steps, in_any_order), std::set<int>{0},
      [&](std::size_t s, std::set<int>& state) {
        if (steps[s].kind == Kind::kPlain && !steps[s].label.empty())
          state = {std::stoi(steps[s].label)};
      },
      [](std::set<int>& state, const std::set<int>& other, const std::string&) {
        state.insert(other.begin(), other.end());
      });
}
Step sets(int number) { return {Kind::kPlain, std::to_string(number)}; }

TEST(Flow, BranchesComeTogether) {
  const auto before = numbers_before({{Kind::kIf},
                                      sets(1),
                                      {Kind::kCase},
                                      sets(2),
                                      {Kind::kElse},
                                      sets(3),
                                      {Kind::kEnd},
                                      {Kind::kPlain}});
  EXPECT_EQ(before[7], (std::set<int>{1, 2, 3}));
  EXPECT_EQ(before[3], std::set<int>{0});
  EXPECT_EQ(numbers_before({{Kind::kIf}, sets(1), {Kind::kEnd}})[3], (std::set<int>{0, 1}));
}

TEST(Flow, TheEndOfALoopLeadsToItsHead) {
  for (const Kind loop : {Kind::kWhile, Kind::kRepeat})
    EXPECT_EQ(numbers_before({{loop}, {Kind::kPlain}, sets(1), {Kind::kEnd}})[1],
              (std::set<int>{0, 1}));
  EXPECT_EQ(numbers_before({{Kind::kWhile}, sets(1), {Kind::kExit}, sets(2), {Kind::kEnd}})[1],
            (std::set<int>{0, 2}));
  EXPECT_EQ(
      numbers_before({{Kind::kLabel, "a"}, {Kind::kPlain}, sets(1), {Kind::kJumpMaybe, "a"}})[1],
      (std::set<int>{0, 1}));
}

TEST(Flow, CallsLeadThroughTheirRoutineAndBack) {
  const std::vector<Step> steps = {{Kind::kRoutine, "main"},
                                   {Kind::kCall, "sub"},
                                   {Kind::kPlain},
                                   {Kind::kEnd},
                                   {Kind::kRoutine, "sub"},
                                   sets(1),
                                   {Kind::kEnd}};
  const auto before = numbers_before(steps);
  EXPECT_EQ(before[2], std::set<int>{1});
  EXPECT_EQ(before[5], std::set<int>{0});
  EXPECT_EQ(numbers_before(steps, true)[1], (std::set<int>{0, 1}));
}

TEST(Flow, AnInterruptMayComeInBeforeAnyStatementAndTakesWhatHoldsThere) {
  const auto before = numbers_before({{Kind::kRoutine, "main"},
                                      sets(1),
                                      {Kind::kPlain},
                                      {Kind::kEnd},
                                      {Kind::kInterrupt, "stopped"},
                                      {Kind::kPlain},
                                      sets(2),
                                      {Kind::kPlain},
                                      {Kind::kEnd}});
  EXPECT_EQ(before[2], (std::set<int>{1, 2}));
  EXPECT_EQ(before[5], (std::set<int>{0, 1, 2}));
  EXPECT_EQ(before[7], std::set<int>{2}) << "nothing interrupts it by itself";
  // One that leaves all as it was changes nothing.
  EXPECT_EQ(numbers_before({{Kind::kRoutine, "main"},
                            sets(1),
                            {Kind::kPlain},
                            {Kind::kEnd},
                            {Kind::kInterrupt, "i"},
                            {Kind::kPlain},
                            {Kind::kEnd}})[2],
            std::set<int>{1});
}

TEST(Flow, AHandlerComesInWhereAStatementFails) {
  const auto with = [](Kind last) {
    return numbers_before({{Kind::kRoutine, "main"},
                           sets(1),
                           {Kind::kPlain},
                           {Kind::kHandler, "error"},
                           {Kind::kPlain},
                           sets(2),
                           {last},
                           {Kind::kEnd},
                           {Kind::kPlain}});
  };
  EXPECT_EQ(with(Kind::kGoBack)[2], (std::set<int>{1, 2}));
  EXPECT_EQ(with(Kind::kGoBack)[4], (std::set<int>{0, 1, 2}));
  EXPECT_EQ(with(Kind::kReturn)[2], std::set<int>{1});
  EXPECT_EQ(with(Kind::kReturn)[7], (std::set<int>{1, 2})) << "both ways end the routine";
}

TEST(Flow, ARoutineEndsWhereItFailsIfItsCallerGoesOn) {
  const auto before = [](Kind last) {
    return numbers_before({{Kind::kRoutine, "main"},
                           {Kind::kCall, "sub"},
                           {Kind::kPlain},
                           {Kind::kHandler, "error"},
                           {last},
                           {Kind::kEnd},
                           {Kind::kRoutine, "sub"},
                           sets(1),
                           {Kind::kPlain},
                           sets(2),
                           {Kind::kEnd}});
  };
  EXPECT_EQ(before(Kind::kGoBack)[2], (std::set<int>{1, 2}));
  EXPECT_EQ(before(Kind::kReturn)[2], std::set<int>{2});
}

TEST(Flow, WhatIsOpenOrStrayIsNoFault) {
  const auto before = numbers_before({{Kind::kEnd},
                                      {Kind::kElse},
                                      {Kind::kJump, "nowhere"},
                                      sets(1),
                                      {Kind::kExit},
                                      {Kind::kIf},
                                      {Kind::kCall, "nothing"},
                                      {Kind::kGoBack},
                                      {Kind::kReturn}});
  EXPECT_EQ(before.size(), 10u);
  EXPECT_EQ(before[4], std::set<int>{1});
  EXPECT_EQ(numbers_before({}).size(), 1u);
  for (const Kind kind : {Kind::kInterrupt, Kind::kHandler, Kind::kGoBack}) {
    EXPECT_EQ(numbers_before({{kind}}).size(), 2u);
    EXPECT_EQ(numbers_before({{Kind::kRoutine, "a"}, {kind}, sets(1)}).size(), 4u);
  }
}

}  // namespace
}  // namespace trammel::cam
