#pragma once

#include <cstddef>
#include <functional>

/// The work that one command computes on all processors.
namespace trammel::cli {

/// Items that a thread takes at a time if each takes microseconds.
inline constexpr std::size_t kTogether = 32;

/// Calls `work(i)` for each i below `count`, in any order, from several threads at once. Returns
/// when all are done. `progress` gets the finished share, from the calling thread alone.
/// `together`: the number of items that a thread takes at a time.
void in_parallel(std::size_t count, const std::function<void(std::size_t)>& work,
                 const std::function<void(double)>& progress, std::size_t together = kTogether);

}  // namespace trammel::cli
