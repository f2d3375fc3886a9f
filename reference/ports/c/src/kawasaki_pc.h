/* What the parts of a PC share. */
#ifndef CELLWIRE_KAWASAKI_PC_PARTS_H
#define CELLWIRE_KAWASAKI_PC_PARTS_H

#include "cellwire/kawasaki_pc.h"
#include "kawasaki.h"

static inline bool is_starting(const struct kawasaki_pc *pc)
{
    return pc->stage >= KAWASAKI_PC_UNSENT && pc->stage <= KAWASAKI_PC_FOREIGN;
}

static inline bool is_running(const struct kawasaki_pc *pc) { return pc->stage >= KAWASAKI_PC_ACTIVE; }

/* KM-98 */
void kawasaki_pc_settle_commands(struct kawasaki_pc *pc, bool is_transmitted);

/* KM-110 */
void kawasaki_pc_over(struct kawasaki_pc *pc);
void kawasaki_pc_lose_outcome(struct kawasaki_pc *pc);

#endif
