#pragma once

namespace trammel {

/// From now on blocks of more than a megabyte go back to the system when they are freed. By itself
/// glibc keeps as much as the largest block that was ever freed, in each arena. Call it before the
/// first thread starts.
void give_large_blocks_back();

}  // namespace trammel
