#include "surface/mesh.h"
