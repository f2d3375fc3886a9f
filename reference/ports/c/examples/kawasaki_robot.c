/* A robot is given an order and its first job, which its motion program executes. */
#include <assert.h>
#include <cellwire/kawasaki_robot.h>
#include <string.h>

int main(void)
{
    static const char sent[] = "<TilausAlkaa$4#50$1#><Tyo$15#50$1$1$0$0$10$0#>";
    static struct kawasaki_slot slots[8];
    static uint8_t jobs[8 * 64], packet[KAWASAKI_MSG_MAX_LEN];
    static struct kawasaki_robot robot;
    struct kawasaki_robot_config config = KAWASAKI_ROBOT_DEFAULT;
    struct kawasaki_robot_job job;
    struct kawasaki_value values[5];
    struct kawasaki_fault fault;
    config.slots = slots;
    config.slot_count = 8;
    config.jobs = jobs;
    config.jobs_size = sizeof jobs;
    assert(kawasaki_robot_init(&robot, &config));
    kawasaki_robot_connected(&robot, 0);
    assert(kawasaki_robot_transmit(&robot, 0, packet, sizeof packet) > 0);
    kawasaki_robot_input(&robot, 1000000, (const uint8_t *)sent, strlen(sent));
    assert(kawasaki_robot_take(&robot, 0, &job) && job.order == 50 && job.number == 1);
    assert(kawasaki_job_read(&KAWASAKI_DIALECT, &job.own, KAWASAKI_DIALECT.job_count, values, &fault) && values[3].number == 10);
    return kawasaki_robot_report(&robot, job.number) && kawasaki_robot_complete(&robot) ? 0 : 1;
}
