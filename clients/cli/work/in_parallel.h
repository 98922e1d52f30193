#pragma once

#include <cstddef>
#include <functional>

/// The work that one command computes on all processors.
namespace trammel::cli {

/// Calls `work(i)` for each i below `count`, in any order, from several threads at once; ends when
/// all are done. `progress`, from the calling thread alone: the share that is done.
void in_parallel(std::size_t count, const std::function<void(std::size_t)>& work,
                 const std::function<void(double)>& progress);

}  // namespace trammel::cli
