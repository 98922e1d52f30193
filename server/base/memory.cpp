#include "server/base/memory.h"

#include <malloc.h>

namespace trammel {

void give_large_blocks_back() {
  constexpr int kLarge = 1 << 20;
  ::mallopt(M_MMAP_THRESHOLD, kLarge);
  ::mallopt(M_TRIM_THRESHOLD, kLarge);
}

}  // namespace trammel
