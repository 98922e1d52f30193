#pragma once

namespace trammel {

/// The marks on the first page of a store's file.
inline constexpr int kApplicationId = 0x54524D4C;  // "TRML"
inline constexpr int kSchemaVersion = 2;

}  // namespace trammel
