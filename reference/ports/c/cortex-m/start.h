/* What the program and its start know of one another. */
#ifndef CELLWIRE_START_H
#define CELLWIRE_START_H

int run(void); /* the program; its exit status */
void say(const char *text);

#endif
