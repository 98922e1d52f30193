#pragma once

#include <string_view>

#include "server/base/result.h"
#include "server/bias/kernel.h"

namespace trammel {

/// `matern52 + periodic`, `se(sincos) * (linear + white)`: words of kernel_names(), each also on (cos q, sin q); `*`
/// binds before `+`. One word alone is that kernel itself. Refuses other words, naming them and those that are known,
/// and what is not such a sum.
[[nodiscard]] Result<KernelPtr> spelled_kernel(std::string_view spelling);

}  // namespace trammel
