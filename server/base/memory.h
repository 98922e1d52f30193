#pragma once

namespace trammel {

/// Makes freed blocks of more than a megabyte go back to the system. By default glibc keeps, in
/// each arena, as much as the largest block that was ever freed. Call it before the first thread
/// starts.
void give_large_blocks_back();

}  // namespace trammel
