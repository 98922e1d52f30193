#pragma once

#include <string_view>
#include <vector>

#include "server/base/result.h"
#include "server/bias/kernels/kernel.h"
#include "server/bias/kernels/linear_block.h"

namespace trammel {

/// `matern52 + periodic`, `se(sincos) * (linear + white)`: words of kernel_names(), each also on (cos q, sin q); `*`
/// binds before `+`. One word alone is that kernel itself. Refuses other words, naming them and those that are known,
/// and what is not such a sum, and more than 32 words or 1000 bytes.
[[nodiscard]] Result<KernelPtr> spelled_kernel(std::string_view spelling);

/// What a bias is made of: what each coordinate has by itself, and what they share.
struct SpelledBias {
  KernelPtr kernel;
  std::vector<LinearBlockPtr> blocks;
  [[nodiscard]] bool has(std::string_view block) const;
};

/// A kernel as above and, added to it once each at most, `joint_map` and `parameters`: `matern52 + joint_map`. Refuses
/// what spelled_kernel() refuses, a block in a product or in parentheses, twice, or without a kernel beside it.
[[nodiscard]] Result<SpelledBias> spelled_bias(std::string_view spelling);

/// Whether a bias can be spelled so; `none` can, and `auto`: the one that choose_bias() takes.
[[nodiscard]] Status check_bias_spelling(std::string_view spelling);

}  // namespace trammel
