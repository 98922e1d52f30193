#include "server/host/caught_signals.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <unistd.h>

#include <future>

namespace trammel {
namespace {

using std::chrono::milliseconds;

/// How often the time was asked for until the process was said to hang, where `lived` says it.
int looks_until_it_hangs(const std::function<milliseconds(int)>& lived) {
  int looks = 0;
  std::promise<int> hangs;
  CaughtSignals signals([&] { hangs.set_value(looks); }, [&] { return lived(++looks); });
  ::kill(::getpid(), SIGTERM);  // to any thread, as from outside: this one blocks it
  return hangs.get_future().get();
}

TEST(CaughtSignals, AnOrderlyStopMayTakeTenSecondsOfTheTimeThatItsProcessLived) {
  EXPECT_EQ(looks_until_it_hangs([](int) { return milliseconds(10'000); }), 1);
  EXPECT_EQ(looks_until_it_hangs([](int) { return milliseconds(2'500); }), 4);
}

TEST(CaughtSignals, TimeInWhichItsProcessWasGivenNoProcessorDoesNotCount) {
  EXPECT_EQ(looks_until_it_hangs([](int look) { return milliseconds(look < 5 ? 0 : 10'000); }), 5);
}

}  // namespace
}  // namespace trammel
