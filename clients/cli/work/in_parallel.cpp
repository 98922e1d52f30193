#include "clients/cli/work/in_parallel.h"

#include <algorithm>
#include <atomic>
#include <thread>
#include <vector>

namespace trammel::cli {

namespace {

constexpr std::size_t kMostThreads = 64;

}  // namespace

void in_parallel(std::size_t count, const std::function<void(std::size_t)>& work,
                 const std::function<void(double)>& progress, std::size_t together) {
  std::atomic<std::size_t> next{0};
  const auto take = [&]() -> bool {
    const std::size_t first = next.fetch_add(together);
    for (std::size_t i = first; i < std::min(first + together, count); ++i) work(i);
    return first < count;
  };
  const std::size_t useful = (count + together - 1) / together;
  const std::size_t threads =
      std::min({useful, kMostThreads, std::size_t{std::thread::hardware_concurrency()}});
  std::vector<std::jthread> others;
  for (std::size_t k = 1; k < threads; ++k) {
    others.emplace_back([&] {
      while (take()) {
      }
    });
  }
  while (take())
    progress(std::min(1.0, static_cast<double>(next.load()) /
                               static_cast<double>(std::max<std::size_t>(count, 1))));
}

}  // namespace trammel::cli
