// The number of round trips of a change to the database. In a plant's network it waits for them,
// besides the disk.
#include <gtest/gtest.h>

#include <vector>

#include "tests/store/store_under_test.h"
#include "tests/support/postgres.h"

namespace trammel {
namespace {

using test::batch_of;
using test::demand;
using test::job_of;

class RoundTrips : public testing::Test, protected test::StoreUnderTest {
 protected:
  static void SetUpTestSuite() { test::Postgres::of_program(); }
  RoundTrips() : StoreUnderTest(test::Postgres::of_program().new_store()) {
    postgres_.write_down(path_);
    open();
    submit(batch_of("before"));  // its cell and a connection are there
  }
  /// What `work` asks of the database.
  template <typename Work>
  std::vector<std::string> asked_by(const Work& work) {
    static_cast<void>(postgres_.asked());
    work();
    return postgres_.asked();
  }
  static std::string listed(const std::vector<std::string>& asked) {
    return fmt::format("{}", fmt::join(asked, "\n"));
  }

  test::Postgres& postgres_ = test::Postgres::of_program();
};

TEST_F(RoundTrips, OfABatchThatIsAcceptedAreSix) {
  const auto asked = asked_by([&] { submit(batch_of("lt-07")); });
  EXPECT_EQ(asked.size(), 6U) << listed(asked);
  EXPECT_EQ(asked.back(), "COMMIT");
}

TEST_F(RoundTrips, OfALookAtWhatThereIsToDoAreThree) {
  for (int i = 0; i < 20; ++i) submit(batch_of(std::to_string(i)));
  const auto asked = asked_by([&] { EXPECT_EQ(demand(store_->jobs_to_take()).size(), 21U); });
  EXPECT_EQ(asked.size(), 3U) << listed(asked);
}

TEST_F(RoundTrips, OfManyJobsThatAreReadAreFour) {
  std::set<std::int64_t> ids;
  for (int i = 0; i < 20; ++i) ids.insert(submit(batch_of(std::to_string(i))));
  const auto asked = asked_by([&] { EXPECT_EQ(demand(store_->jobs(ids)).size(), 20U); });
  EXPECT_EQ(asked.size(), 4U) << listed(asked);
}

TEST_F(RoundTrips, OfAClaimThatIsKeptAreThree) {
  const std::int64_t job = submit(batch_of("lt-07"));
  ASSERT_TRUE(store_->set_job_running(job));
  const auto asked = asked_by([&] { EXPECT_TRUE(demand(store_->renew_claim(job)).is_held); });
  EXPECT_EQ(asked.size(), 3U) << listed(asked);
}

}  // namespace
}  // namespace trammel
