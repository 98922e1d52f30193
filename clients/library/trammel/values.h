#pragma once

// The installed header is a copy of the room's own.
#include "server/exchange/values.h"
