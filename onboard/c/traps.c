/* Linked to the examples by run.sh: a division by zero, an overflow or an invalid operation ends the program, as in
 * ArduPilot's simulator and in firmware that traps them. */
#define _GNU_SOURCE
#include <fenv.h>

#ifdef __GLIBC__
__attribute__((constructor)) static void set_traps(void)
{
    (void)feenableexcept(FE_DIVBYZERO | FE_INVALID | FE_OVERFLOW);
}
#endif
