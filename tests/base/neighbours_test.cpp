#include "server/base/neighbours.h"

#include <gtest/gtest.h>

namespace trammel {
namespace {

using Names = std::vector<std::string>;

const std::vector<Account> kAccounts = {{"root", 0, "/bin/bash"},
                                        {"postgres", 101, "/bin/bash"},
                                        {"anna", 1000, "/bin/bash"},
                                        {"ben", 1001, "/usr/bin/zsh"},
                                        {"backup", 1002, "/usr/sbin/nologin"},
                                        {"printer", 1003, "/bin/false"},
                                        {"nobody", 65534, "/usr/sbin/nologin"}};

TEST(Neighbours, AreOtherPeopleWhoMayLogIn) {
  const Neighbours found = neighbours_among(kAccounts, {0, 1001, 1002}, {1000});
  EXPECT_EQ(found.may_log_in, Names{"ben"});
  EXPECT_EQ(found.logged_in, Names{"ben"});
}

TEST(Neighbours, AnAccountThatNobodyUsesNowMayStillLogIn) {
  const Neighbours found = neighbours_among(kAccounts, {0}, {0});
  EXPECT_EQ(found.may_log_in, (Names{"anna", "ben"}));
  EXPECT_EQ(found.logged_in, Names{});
}

TEST(Neighbours, AMachineOfOnePersonHasNone) {
  EXPECT_EQ(neighbours_among({kAccounts[0], kAccounts[2]}, {1000}, {0, 1000}).may_log_in, Names{});
}

}  // namespace
}  // namespace trammel
