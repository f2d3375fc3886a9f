-- ISRA Robot Command Teach Ball, as isra-ball.md describes it.
--
-- README.md says how to install it.

local ball = Proto("isra_ball", "ISRA Robot Command Teach Ball")
local ENQ = 0x05

ball.prefs.ball_is_server = Pref.bool("The ball is the server of the TCP connection", true,
    "Whether the ball, or the adapter at its port, accepted the connection")

local f = ball.fields
f.poll = ProtoField.bool("isra_ball.poll", "Poll (ENQ)")
f.length = ProtoField.uint8("isra_ball.length", "Data bytes", base.DEC)
f.sensor_type = ProtoField.uint8("isra_ball.sensor_type", "Sensor type", base.DEC)
f.sensor = ProtoField.uint8("isra_ball.sensor", "Sensor number", base.DEC)
f.status = ProtoField.string("isra_ball.status", "Status")
f.force = ProtoField.int8("isra_ball.force", "Force", base.DEC)
f.moment = ProtoField.int8("isra_ball.moment", "Moment", base.DEC)
f.keys = ProtoField.uint8("isra_ball.keys", "Keys", base.DEC)
f.data = ProtoField.uint8("isra_ball.data", "Data of unknown layout", base.DEC)
f.checksum = ProtoField.uint8("isra_ball.checksum", "Checksum", base.HEX)
f.decode_error = ProtoField.string("isra_ball.decode_error", "Error")
f.request_in = ProtoField.framenum("isra_ball.request_in", "Poll in", base.NONE, frametype.REQUEST)
f.response_time = ProtoField.double("isra_ball.response_time", "Response time in seconds")

local e = {
    checksum = ProtoExpert.new("isra_ball.bad_checksum", "Bad checksum", expert.group.CHECKSUM, expert.severity.ERROR),
    noise = ProtoExpert.new("isra_ball.noise", "No packet", expert.group.MALFORMED, expert.severity.ERROR),
    unknown = ProtoExpert.new("isra_ball.unknown", "Not a poll", expert.group.PROTOCOL, expert.severity.WARN),
    layout = ProtoExpert.new("isra_ball.layout", "Packet of unknown layout", expert.group.UNDECODED, expert.severity.NOTE),
    unasked = ProtoExpert.new("isra_ball.unasked", "Packet without a poll", expert.group.SEQUENCE, expert.severity.WARN),
    missed = ProtoExpert.new("isra_ball.missed", "Poll before the reply to the last one", expert.group.SEQUENCE, expert.severity.NOTE),
}
ball.experts = { e.checksum, e.noise, e.unknown, e.layout, e.unasked, e.missed }

local stream_field = Field.new("tcp.stream")
local open_polls, matches = {}, {}

function ball.init()
    open_polls, matches = {}, {}
end

local function stream_of(pinfo)
    local stream = stream_field()
    return stream and stream.value or 0
end

--- Whether up to three bytes can begin a packet.
local function is_header(tvb, at)
    local n = tvb(at, 1):uint()
    local left = tvb:len() - at
    if left > 1 and tvb(at + 1, 1):uint() ~= (256 - n) % 256 then return false end
    return left < 3 or tvb(at + 2, 1):uint() == bit.bxor(n, 0x55)
end

--- The next place after `at` where a packet may begin, or the end.
local function next_header(tvb, at)
    for place = at + 1, tvb:len() - 1 do
        if is_header(tvb, place) then return place end
    end
    return tvb:len()
end

local function show_packet(tvb, tree, info)
    local n = tvb(0, 1):uint()
    tree:add(f.length, tvb(0, 1))
    if n == 8 then
        local id = tvb(3, 1):uint()
        tree:add(f.sensor_type, tvb(3, 1), bit.band(bit.rshift(id, 4), 7))
        tree:add(f.sensor, tvb(3, 1), bit.band(id, 7))
        local status = ({ [0] = "fresh", [0x80] = "old" })[bit.band(id, 0x88)] or "reserved"
        tree:add(f.status, tvb(3, 1), status)
        for axis = 4, 6 do tree:add(f.force, tvb(axis, 1)) end
        for axis = 7, 9 do tree:add(f.moment, tvb(axis, 1)) end
        tree:add(f.keys, tvb(10, 1))
        table.insert(info, "Packet " .. status)
    else
        for at = 3, 2 + n do tree:add(f.data, tvb(at, 1)) end
        tree:add_proto_expert_info(e.layout)
        table.insert(info, "Packet of " .. n .. " data bytes")
    end
    tree:add(f.checksum, tvb(3 + n, 1))
end

local function show_error(tvb, tree, kind, info)
    tree:add(f.decode_error, tvb(), kind)
    tree:add_proto_expert_info(e[kind])
    table.insert(info, "Error " .. kind)
end

local function match(pinfo, tree, at)
    local key = pinfo.number .. ":" .. at
    if not pinfo.visited then
        local stream = stream_of(pinfo)
        local poll = open_polls[stream]
        matches[key] = poll and { number = poll.number, time = tonumber(tostring(pinfo.abs_ts)) - poll.time } or {}
        open_polls[stream] = nil
    end
    local found = matches[key]
    if found and found.number then
        tree:add(f.request_in, found.number):set_generated()
        tree:add(f.response_time, found.time):set_generated()
    else
        tree:add_proto_expert_info(e.unasked)
    end
end

local function dissect_packets(tvb, pinfo, tree, info)
    local at = 0
    while at < tvb:len() do
        local left = tvb:len() - at
        local n = tvb(at, 1):uint()
        if is_header(tvb, at) and left < n + 4 then
            pinfo.desegment_offset = at
            -- Not the bytes that are missing: what follows a cut packet shows where the next one begins.
            pinfo.desegment_len = DESEGMENT_ONE_MORE_SEGMENT
            return
        end
        local sum = 0
        for place = at, is_header(tvb, at) and at + n + 3 or at - 1 do
            sum = sum + (place > at and place < at + 3 and 0 or tvb(place, 1):uint())
        end
        if is_header(tvb, at) and sum % 256 == 0 then
            local packet = tree:add(ball, tvb(at, n + 4))
            show_packet(tvb(at, n + 4):tvb(), packet, info)
            match(pinfo, packet, at)
            at = at + n + 4
        else
            local kind = is_header(tvb, at) and "checksum" or "noise"
            local to = next_header(tvb, at)
            show_error(tvb(at, to - at), tree:add(ball, tvb(at, to - at)), kind, info)
            at = to
        end
    end
end

local function dissect_polls(tvb, pinfo, tree, info)
    for at = 0, tvb:len() - 1 do
        local item = tree:add(ball, tvb(at, 1))
        if tvb(at, 1):uint() == ENQ then
            item:add(f.poll, tvb(at, 1), true)
            local stream = stream_of(pinfo)
            if not pinfo.visited then
                matches[pinfo.number .. ":" .. at] = { again = open_polls[stream] ~= nil }
                open_polls[stream] = { number = pinfo.number, time = tonumber(tostring(pinfo.abs_ts)) }
            end
            if (matches[pinfo.number .. ":" .. at] or {}).again then item:add_proto_expert_info(e.missed) end
            table.insert(info, "Poll")
        else
            show_error(tvb(at, 1), item, "unknown", info)
        end
    end
end

function ball.dissector(tvb, pinfo, tree)
    pinfo.cols.protocol = "ISRA ball"
    local info = {}
    local from_server = pinfo.src_port == pinfo.match_uint
    if from_server == ball.prefs.ball_is_server then
        dissect_packets(tvb, pinfo, tree, info)
    else
        dissect_polls(tvb, pinfo, tree, info)
    end
    if #info > 0 then pinfo.cols.info = table.concat(info, ", ") end
end

DissectorTable.get("tcp.port"):add_for_decode_as(ball)
