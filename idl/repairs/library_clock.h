#pragma once

namespace trammel::wire {

/// Fixes the clock by which the library dates what it sends: Unix time as it is now, and from then
/// on a clock that nobody sets. Fast DDS itself dates by the host's clock, and before 1970 it
/// counts for ever, with its locks held.
void start_library_clock();

}  // namespace trammel::wire
