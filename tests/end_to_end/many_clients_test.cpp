#include <gtest/gtest.h>

#include <memory>
#include <vector>

#include "tests/support/daemon.h"

namespace trammel {
namespace {

// The library looks for free ports as often as it is told, and then makes a participant that hears nothing.
TEST(ManyClients, TheHundredAndThirtiethOfAHostIsAnsweredAsTheFirst) {
  test::Daemon daemon;
  daemon.start();
  std::vector<std::unique_ptr<client::Session>> clients;
  for (int i = 0; i < 130; ++i) {
    auto opened = client::Session::open(daemon.session_options());
    ASSERT_TRUE(opened) << "client " << i << ": " << sentence(opened.error());
    clients.push_back(std::move(*opened));
  }
  for (const auto* client : {&clients.front(), &clients.back()}) {
    const auto models = (*client)->models("cell-7");
    EXPECT_TRUE(models) << sentence(models.error());
  }
}

}  // namespace
}  // namespace trammel
